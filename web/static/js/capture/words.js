// What the page says: what to do now, and one sentence for what is wrong.
import { STAND_S } from "../common/standing.js";
import { fixed, plural, speak, translate } from "../common/words.js";

// By the stage the server is at (its "state" messages); before the first one, by the time since the start.
// toDo: what the person of a guided test does now, in the server's words.
export function instruction(stage, elapsedS, toDo = null) {
  if (toDo) return { icon: "walk", title: translate(toDo), more: speak`The clock starts and stops automatically.` };
  switch (stage ?? (elapsedS < STAND_S ? "stand" : "recording")) {
    case "waiting": return { icon: "info", title: speak`Please wait`, more: speak`The server is waiting for all sensors.` };
    case "stand":
      return { icon: "users", title: speak`Stand still`, more: speak`Feet as in walking, arms at the sides, for ${STAND_S} seconds.` };
    case "walk": return { icon: "walk", title: speak`Walk straight ahead`, more: speak`At your own pace, at least eight steps.` };
    case "running":
      return { icon: "walk", title: speak`Continue`, more: speak`The avatar is shown on the clinic's screen. Stop when the exercise is over.` };
    default: return { icon: "walk", title: speak`Recording`, more: speak`Stop when the exercise is over.` };
  }
}

export const REDO = speak`Use Redo on the clinic's screen: stand still again, then walk. Or continue; the analysis evaluates the whole trial.`;

export const RELOADED = {
  icon: "info", title: speak`This page was reloaded`,
  more: speak`Everything up to then is saved. Reconnect the same sensors to continue, or stop here.`,
};

export function sendingRest(heldS) {
  const left = speak`${fixed(heldS, 1)} s are still on this tablet. Keep this page open.`;
  return { icon: "upload", title: speak`Sending remaining data`, more: heldS > 0.05 ? left : speak`The server is closing the recording.` };
}

// When the take is over: `marked` = count or hash differed, and it was kept all the same.
export function ending(batches, marked) {
  const another = speak`A new recording requires a new code.`;
  if (!batches) return { title: speak`Nothing was recorded`, more: speak`No sensor sent any data. ${another}` };
  if (marked) {
    return {
      title: speak`Recording is on the server, with a warning`,
      more: speak`Tablet and server counted different numbers of samples. Check the recording on the visit page before relying on it.`,
    };
  }
  return {
    title: speak`Recording is on the server`,
    more: speak`It is being analysed; the result will appear on the visit page. ${another}`,
  };
}

export const OTHER_TAB = {
  title: speak`This page is open in another tab`, detail: speak`Continue there, or close it and reload this page.`,
};

export const OTHER_TAKE = {
  title: speak`This code belongs to another recording`,
  detail: speak`Part of the previous recording is only on this tablet. Save or delete it first.`,
};

export const NOT_THOSE = speak`These are not the sensors this recording started with. Connect the same sensors, or stop here.`;

export const loss = (heldS) => speak`${fixed(heldS, 1)} s of the recording are not on the server and cannot be recovered.`;

// Why the socket ended for good.
export function linkProblem({ code, detail }, heldS) {
  const left = heldS > 0.05 ? speak` ${fixed(heldS, 1)} s are only on this tablet.` : "";
  const save = speak`Save the remaining data here and inform the administrator.`;
  switch (code) {
    case "token": {
      const how = speak`Request a new code on the visit's live page and enter it here; recording continues from where it stopped.`;
      return { title: speak`The pairing has ended`, detail: how + left };
    }
    case "ended": {
      const keep = speak`${left.trim()} Save them as a file that can be uploaded to a separate visit, or delete them.`;
      const detailed = left ? keep : speak`Everything from this tablet is on the server.`;
      return { title: speak`The recording was ended on the clinic's screen`, detail: detailed };
    }
    case "lost": return { title: speak`The server has lost part of this recording`, detail: `${translate(detail)} ${save}` };
    case "replaced": return { title: speak`Another tablet or page took over this recording`, detail: speak`Continue there.${left}` };
    case "finish_mismatch": return { title: speak`Tablet and server data differ`, detail: `${translate(detail)} ${save}` };
    default: return { title: speak`The server refused the recording`, detail: `${translate(detail) || speak`No reason was given.`}${left}` };
  }
}

export const serverFull = (detail) => ({
  title: speak`The server cannot accept data at the moment`, detail: speak`${translate(detail)} It is stored here and sent later.`,
});

export function storageProblem(error) {
  if (error.name === "QuotaExceededError") {
    return {
      title: speak`This tablet's storage is full`,
      detail: speak`Recording continues, but data not yet on the server would be lost by reloading. Keep this page open and restore the network.`,
    };
  }
  return {
    title: speak`This tablet cannot store data`,
    detail: speak`Keep this page open: reloading would lose data not yet on the server (${error.message}).`,
  };
}

// Title and sentence for the first worn sensor that does not send.
export function sensorProblem(number, place, sensor, health, running) {
  const silent = sensor.meter.silentS();
  const none = health.text === speak`No data`;
  const got = none ? (silent === null ? speak`received 0` : speak`received 0 for ${Math.round(silent)} s`) : speak`received ${Math.round(health.rateHz)}`;
  const wake = speak`Move it to wake it, or start without it: its values are then estimated or missing.`;
  const closer = speak`Bring it closer to the tablet; it resumes automatically.`;
  return {
    title: none ? speak`Sensor ${number} on the ${place} is not sending` : speak`Sensor ${number} on the ${place} is sending too slowly`,
    detail: speak`Expected ${Math.round(Math.max(sensor.rateHz, 40))} samples a second, ${got}. ${running ? closer : wake}`,
  };
}

export function hours(value) {
  if (value === null) return speak`this tablet stores the data until then`;
  if (value > 24) return speak`this tablet can store more than a day of data`;
  if (value >= 1) return speak`this tablet can store ${Math.floor(value)} h of data`;
  return speak`this tablet can store only ${Math.max(1, Math.floor(value * 60))} min of data`;
}

/** @param {number} n */
export const asBefore = (n) => plural(n, speak`As last time: 1 sensor`, speak`As last time: ${n} sensors`);
