// What the page says: what to do now, and one sentence for what is wrong.
import { STAND_S } from "../common/standing.js";

// By the stage the server is at (its "state" messages); before the first one, by the time since the start.
// toDo: what the person of a guided test does now, in the server's words.
export function instruction(stage, elapsedS, toDo = null) {
  if (toDo) return { icon: "walk", title: toDo, more: "The clock starts and stops by itself." };
  switch (stage ?? (elapsedS < STAND_S ? "stand" : "recording")) {
    case "waiting": return { icon: "info", title: "Wait a moment", more: "The server waits for all sensors." };
    case "stand":
      return { icon: "users", title: "Stand still", more: `Feet as in walking, arms at the sides, for ${STAND_S} seconds.` };
    case "walk": return { icon: "walk", title: "Walk straight on", more: "At your own pace, at least eight steps." };
    case "running":
      return { icon: "walk", title: "Go on", more: "The figure moves on the clinic's screen. Stop when the exercise is over." };
    default: return { icon: "walk", title: "Recording", more: "Stop when the exercise is over." };
  }
}

export const REDO = "The clinic's screen has Redo: stand still again, then walk. Or go on; the analysis judges the whole take.";

export const RELOADED = {
  icon: "info", title: "This page was loaded again",
  more: "Everything up to then is safe. Connect the same sensors again to go on, or stop here.",
};

export function sendingRest(heldS) {
  const left = `${heldS.toFixed(1)} s are still on this tablet. Keep this page open.`;
  return { icon: "upload", title: "Sending the rest", more: heldS > 0.05 ? left : "The server closes the recording." };
}

// When the take is over: `marked` = count or hash differed, and it was kept all the same.
export function ending(batches, marked) {
  const another = "Another recording needs a new code.";
  if (!batches) return { title: "Nothing was recorded", more: `No sensor had sent anything. ${another}` };
  if (marked) {
    return {
      title: "Recording is on the server, with a mark",
      more: "Tablet and server did not count the same. Look at the recording on the session's page before you rely on it.",
    };
  }
  return {
    title: "Recording is on the server",
    more: `It is being analysed; the result is on the session's page. ${another}`,
  };
}

export const OTHER_TAB = {
  title: "This page is open in another tab", detail: "Go on there, or close it and reload this one.",
};

export const OTHER_TAKE = {
  title: "This code belongs to another recording",
  detail: "Part of the earlier one is still on this tablet only. Save or delete it first.",
};

export const NOT_THOSE = "These are not the sensors this recording began with. Connect the same ones, or stop here.";

export const loss = (heldS) => `${heldS.toFixed(1)} s of the recording are not on the server and cannot be brought back.`;

// Why the socket ended for good.
export function linkProblem({ code, detail }, heldS) {
  const left = heldS > 0.05 ? ` ${heldS.toFixed(1)} s are still on this tablet only.` : "";
  const save = "Save what is left here and tell the person who runs the server.";
  switch (code) {
    case "token": {
      const how = "Ask for a new code on the session's live page and enter it here; recording goes on from where it stopped.";
      return { title: "The pairing is over", detail: how + left };
    }
    case "ended": {
      const keep = `${left.trim()} Save them as a file, which can be uploaded to a session of its own, or delete them.`;
      const detailed = left ? keep : "Everything from this tablet is on the server.";
      return { title: "The recording was ended on the clinic's screen", detail: detailed };
    }
    case "lost": return { title: "The server has lost part of this recording", detail: `${detail} ${save}` };
    case "replaced": return { title: "Another tablet or page took over this recording", detail: `Go on there.${left}` };
    case "finish_mismatch": return { title: "Tablet and server do not hold the same", detail: `${detail} ${save}` };
    default: return { title: "The server refused the recording", detail: `${detail || "It gave no reason."}${left}` };
  }
}

export const serverFull = (detail) => ({
  title: "The server cannot take data now", detail: `${detail} It is kept here and sent later.`,
});

export function storageProblem(error) {
  if (error.name === "QuotaExceededError") {
    return {
      title: "This tablet's storage is full",
      detail: "Recording goes on, but what is not on the server would be lost by a reload. Keep this page open and bring the network back.",
    };
  }
  return {
    title: "This tablet cannot store data",
    detail: `Keep this page open: a reload would lose what is not on the server yet (${error.message}).`,
  };
}

// Title and sentence for the first worn sensor that does not send.
export function sensorProblem(number, place, sensor, health, running) {
  const silent = sensor.meter.silentS();
  const none = health.text === "No data";
  const got = none ? `received 0${silent === null ? "" : ` for ${Math.round(silent)} s`}` : `received ${Math.round(health.rateHz)}`;
  const wake = "Wake it by moving it, or start without it: what it would measure is then estimated or missing.";
  const closer = "Bring it closer to the tablet; it goes on by itself.";
  return {
    title: `Sensor ${number} on the ${place} ${none ? "sends nothing" : "sends too slowly"}`,
    detail: `Expected ${Math.round(Math.max(sensor.rateHz, 40))} samples a second, ${got}. ${running ? closer : wake}`,
  };
}

export function hours(value) {
  if (value === null) return "this tablet keeps the data until then";
  if (value > 24) return "this tablet keeps more than a day of data";
  if (value >= 1) return `this tablet keeps ${Math.floor(value)} h of data`;
  return `this tablet keeps only ${Math.max(1, Math.floor(value * 60))} min of data`;
}

/** @param {number} n */
export const asBefore = (n) => `As last time: ${n} sensor${n === 1 ? "" : "s"}`;
