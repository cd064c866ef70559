"use strict";

// The list of drones, requested every second.

const PERIOD = 1000; // ms

const rows = new Map(); // system id -> list item
const answers = new Answers("/drones");

function row(drone) {
  let item = rows.get(drone.sysid);
  if (item === undefined) {
    item = document.createElement("li");
    for (const name of ["name", "state"]) {
      const part = document.createElement(name === "name" ? "a" : "span");
      part.className = name;
      item.append(part);
    }
    rows.set(drone.sysid, item);
    document.getElementById("drones").append(item);
  }
  return item;
}

function show(drones) {
  for (const [sysid, item] of rows) {
    if (drones.some((drone) => drone.sysid === sysid)) continue; // a restarted gateway may have others
    item.remove();
    rows.delete(sysid);
  }
  for (const drone of drones) {
    const item = row(drone);
    item.querySelector(".name").textContent = drone.name;
    item.querySelector(".name").href = `/drone/${drone.sysid}`;
    item.querySelector(".state").textContent =
      `System ${drone.sysid}` + (drone.model ? `, ${drone.model}` : "") +
      (drone.connected ? ", connected" : `, not connected: ${drone.problem}`);
  }
}

async function refresh() {
  const problem = document.getElementById("problem");
  try {
    show(await answers.next());
    problem.textContent = "";
  } catch (error) {
    problem.textContent = answers.missed(error);
  }
  setTimeout(refresh, PERIOD);
}

refresh();
