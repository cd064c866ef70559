"use strict";

// The status of the gateway, requested every second. Every text of a peer enters the page as text, never as HTML.

const PERIOD = 1000; // ms

const cards = new Map(); // system id -> {item, picture, video, open}
const answers = new Answers("/status.json");

function element(kind, text, name = "") {
  const made = document.createElement(kind);
  made.textContent = text;
  if (name) made.className = name;
  return made;
}

function number(value, unit, digits = 0) {
  return value === null ? "–" : `${value.toFixed(digits)}${unit}`;
}

function amount(bytes) {
  if (bytes < 1000) return `${Math.round(bytes)} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(1)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function duration(seconds) {
  if (seconds < 120) return `${Math.round(seconds)} s`;
  return seconds < 7200 ? `${Math.round(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

function quantiles(found) {
  return found.count ? `${number(found.p50_ms, "", 1)} / ${number(found.p99_ms, " ms", 1)}` : "–";
}

function card(drone) {
  let held = cards.get(drone.sysid);
  if (held !== undefined) return held;
  const item = document.createElement("li");
  const video = document.createElement("video");
  Object.assign(video, { autoplay: true, muted: true, playsInline: true, hidden: true, className: "picture" });
  const button = element("button", "Picture");
  held = { item, video, button, picture: new LivePicture(video, drone.sysid), open: false };
  button.addEventListener("click", () => {
    held.open = !held.open;
    video.hidden = !held.open;
    if (!held.open) held.picture.close();
  });
  const parts = {};
  for (const part of ["name", "state", "flight", "link", "commands", "warnings"]) {
    parts[part] = element("div", "", part);
    item.append(parts[part]);
  }
  item.append(button, video);
  held.parts = parts;
  cards.set(drone.sysid, held);
  document.getElementById("drones").append(item);
  return held;
}

// Remove the cards of drones that a restarted gateway no longer has.
function keepOnly(drones) {
  for (const [sysid, held] of cards) {
    if (drones.some((drone) => drone.sysid === sysid)) continue;
    if (held.picture.session !== null) held.picture.close();
    held.item.remove();
    cards.delete(sysid);
  }
}

async function showDrone(drone) {
  const held = card(drone), { parts } = held;
  held.item.classList.toggle("lost", !drone.connected);
  held.item.classList.toggle("warned", drone.connected && drone.warnings.length > 0);
  parts.name.textContent = `${drone.name} (system ${drone.sysid})`;
  parts.state.textContent = drone.connected
    ? `${drone.model} ${drone.serial}, firmware ${drone.firmware || "not reported"}`
    : `Not connected: ${drone.problem}`;
  parts.flight.textContent = !drone.connected ? "" :
    `${drone.mode}, ${drone.armed ? "armed" : "disarmed"}, ${drone.flying.toLowerCase().replace("_", " ")}, ` +
    `height ${number(drone.height_m, " m", 1)}, battery ${number(drone.battery_percent, " %")}, ` +
    `GPS ${drone.gps_fix ? "fix" : "no fix"} (${number(drone.satellites, "")})`;
  parts.link.textContent = !drone.connected ? "" :
    `Radio ${number(drone.radio_quality, "/5")}, ${number(drone.radio_dbm, " dBm")}, ` +
    `last heard ${number(drone.silence_s, " s", 1)} ago, connections ${drone.connections}, viewers ${drone.viewers}` +
    (drone.operator ? `, operator system ${drone.operator}` : "") +
    (drone.operator && drone.secondaries.length ? ` (secondaries ${drone.secondaries.join(", ")})` : "");
  parts.commands.textContent = `Commands p50 / p99: ${quantiles(drone.commands.latency)}`;
  parts.warnings.replaceChildren(...drone.warnings.map((text) => element("div", text)));
  held.button.hidden = !drone.stream;
  if (held.open && drone.stream) await held.picture.watch(drone.stream);
  else if (held.picture.session !== null) held.picture.close();
}

function endpoint(one) {
  const item = document.createElement("li");
  item.append(element("div", one.state, "name"));
  for (const client of one.clients) {
    const dropped = client.dropped_bytes ? `, dropped ${amount(client.dropped_bytes)}` : "";
    const heard = client.silence_s === null ? "never heard" : `heard ${number(client.silence_s, " s", 1)} ago`;
    item.append(element("div",
      `${client.name}: ${client.systems.join(", ") || "no system"}, ${heard}, ` +
      `out ${amount(client.sent_rate)}/s, in ${amount(client.received_rate)}/s${dropped}`));
  }
  for (const [reason, count] of Object.entries(one.refused)) {
    item.append(element("div", `Refused, ${reason}: ${count}`, "warnings"));
  }
  for (const [name, count] of Object.entries(one.counters)) {
    item.append(element("div", `${name.replaceAll("_", " ")}: ${count}`));
  }
  return item;
}

function row(cells, kind = "td") {
  const made = document.createElement("tr");
  made.append(...cells.map((cell) => element(kind, cell)));
  return made;
}

function show(status) {
  document.getElementById("gateway").textContent =
    `Version ${status.program}, process ${status.pid}, up ${duration(status.uptime_s)}, ` +
    `timers late p50 / p99: ${quantiles(status.loop_delay)}` + status.problems.map((text) => `; ${text}`).join("");
  document.getElementById("endpoints").replaceChildren(...status.endpoints.map(endpoint));
  const refused = status.drones.flatMap((drone) => drone.commands.refused.map((one) => ({ drone, ...one })));
  refused.sort((one, other) => one.age_s - other.age_s);
  document.getElementById("refused").replaceChildren(
    row(["ago", "drone", "from", "command", "result", "reason"], "th"),
    ...refused.map((one) =>
      row([duration(one.age_s), one.drone.name, one.sender, one.command, one.result, one.reason])));
  const counters = Object.entries(status.counters).sort();
  document.getElementById("counters").replaceChildren(...counters.map(([name, count]) => row([name, String(count)])));
}

async function refresh() {
  const problem = document.getElementById("problem");
  try {
    const status = await answers.next();
    show(status);
    keepOnly(status.drones);
    for (const drone of status.drones) await showDrone(drone);
    problem.textContent = "";
  } catch (error) {
    problem.textContent = answers.missed(error);
  }
  setTimeout(refresh, PERIOD);
}

addEventListener("pagehide", () => { for (const held of cards.values()) held.picture.close(); });
refresh();
