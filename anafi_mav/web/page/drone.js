"use strict";

// The page of one drone: its live picture, and its state, requested every second.

const PERIOD = 1000; // ms between two looks at drone and picture

const sysid = Number(location.pathname.split("/").pop());
const video = document.getElementById("picture");
const picture = new LivePicture(video, sysid);
const answers = new Answers("/drones");

function show(drone) {
  document.title = `${drone.name} – anafi-mav`;
  document.getElementById("name").textContent = drone.name;
  const shown = picture.playing
    ? `, ${drone.stream} ${video.videoWidth} × ${video.videoHeight}, ${picture.session.rate} pictures/s`
    : "";
  document.getElementById("state").textContent =
    `System ${drone.sysid}` + (drone.model ? `, ${drone.model}` : "") + shown;
}

function problem(drone) {
  if (drone === undefined) return `The gateway has no drone with system id ${sysid}.`;
  if (!drone.connected) return `Not connected: ${drone.problem}`;
  if (!drone.stream) return "No picture: the video is switched off in the gateway's configuration.";
  return picture.failure ? `No picture: ${picture.failure}` : "";
}

async function refresh() {
  let text;
  try {
    const drone = (await answers.next()).find((one) => one.sysid === sysid);
    if (drone === undefined || !drone.connected) {
      if (picture.session !== null) picture.close();
    } else {
      await picture.watch(drone.stream);
    }
    if (drone !== undefined) show(drone);
    text = problem(drone);
  } catch (error) {
    text = answers.missed(error);
  }
  document.getElementById("problem").textContent = text;
  setTimeout(refresh, PERIOD);
}

addEventListener("pagehide", () => picture.close());
refresh();
