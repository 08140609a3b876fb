// What the page says: what to do now, and one sentence for what is wrong.
const STILL_S = 5;

// By the stage the server is at (its "state" messages); before the first one, by the time since the start.
export function instruction(stage, elapsedS) {
  switch (stage ?? (elapsedS < STILL_S ? "stand" : "recording")) {
    case "waiting": return { icon: "info", title: "Wait a moment", more: "The server waits for all sensors." };
    case "stand": return { icon: "users", title: "Stand still", more: "Feet beside each other, arms at the sides, for 5 seconds." };
    case "walk": return { icon: "walk", title: "Walk straight on", more: "At your own pace, at least eight steps." };
    case "running": return { icon: "walk", title: "Go on", more: "The figure moves on the clinic's screen. Stop when the exercise is over." };
    default: return { icon: "walk", title: "Recording", more: "Stop when the exercise is over." };
  }
}

// When the take is over: `marked` = count or hash differed, and it was kept all the same.
export function ending(batches, marked) {
  if (!batches) return { title: "Nothing was recorded", more: "No sensor had sent anything. Another recording needs a new code." };
  if (marked) return { title: "Recording is on the server, with a mark", more: "Tablet and server did not count the same. Look at the recording on the session's page before you rely on it." };
  return { title: "Recording is on the server", more: "It is being analysed; the result is on the session's page. Another recording needs a new code." };
}

// Why the socket ended for good.
export function linkProblem({ code, detail }, heldS) {
  const left = heldS > 0.05 ? ` ${heldS.toFixed(1)} s are still on this tablet only.` : "";
  switch (code) {
    case "token": return { title: "The pairing is over", detail: `Ask for a new code on the session's live page and enter it here; recording goes on from where it stopped.${left}` };
    case "ended": return { title: "The recording was ended on the clinic's screen", detail: left ? `${left.trim()} Save them as a file and upload it to the session, or delete them.` : "Everything from this tablet is on the server." };
    case "lost": return { title: "The server has lost part of this recording", detail: `${detail} Save what is left here and tell the person who runs the server.` };
    case "replaced": return { title: "Another tablet or page took over this recording", detail: `Go on there.${left}` };
    case "finish_mismatch": return { title: "Tablet and server do not hold the same", detail: `${detail} Save what is left here and tell the person who runs the server.` };
    default: return { title: "The server refused the recording", detail: `${detail || "It gave no reason."}${left}` };
  }
}

export function storageProblem(error) {
  if (error.name === "QuotaExceededError") {
    return { title: "This tablet's storage is full", detail: "Recording goes on, but what is not on the server would be lost by a reload. Keep this page open and bring the network back." };
  }
  return { title: "This tablet cannot store data", detail: `Keep this page open: a reload would lose what is not on the server yet (${error.message}).` };
}

// Title and sentence for the first worn sensor that does not send.
export function sensorProblem(number, words, sensor, health, running) {
  const silent = sensor.meter?.silentS() ?? null;
  const got = health.text === "No data" ? `received 0${silent === null ? "" : ` for ${Math.round(silent)} s`}` : `received ${Math.round(health.rateHz)}`;
  return {
    title: `Sensor ${number} on the ${words} ${health.text === "No data" ? "sends nothing" : "sends too slowly"}`,
    detail: `Expected ${Math.round(Math.max(sensor.rateHz, 40))} samples a second, ${got}. ${running ? "Bring it closer to the tablet; it goes on by itself." : "Wake it by moving it, or start without it: what it would measure is then estimated or missing."}`,
  };
}

export const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, "0")}`;

export function hours(value) {
  if (value === null) return "this tablet keeps the data until then";
  return value > 24 ? "this tablet keeps more than a day of data" : value >= 1 ? `this tablet keeps ${Math.floor(value)} h of data` : `this tablet keeps only ${Math.max(1, Math.floor(value * 60))} min of data`;
}
