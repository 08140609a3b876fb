// What the page says: what to do now, and one sentence for what is wrong.
import { STAND_S } from "../common/standing.js";
import { fixed, plural, speak, translate } from "../common/words.js";

// By the stage the server is at (its "state" messages); before the first one, by the time since the start.
// toDo: what the person of a guided test does now, in the server's words.
export function instruction(stage, elapsedS, toDo = null) {
  if (toDo) return { icon: "walk", title: translate(toDo), more: speak`The clock starts and stops by itself.` };
  switch (stage ?? (elapsedS < STAND_S ? "stand" : "recording")) {
    case "waiting": return { icon: "info", title: speak`Wait a moment`, more: speak`The server waits for all sensors.` };
    case "stand":
      return { icon: "users", title: speak`Stand still`, more: speak`Feet as in walking, arms at the sides, for ${STAND_S} seconds.` };
    case "walk": return { icon: "walk", title: speak`Walk straight on`, more: speak`At your own pace, at least eight steps.` };
    case "running":
      return { icon: "walk", title: speak`Go on`, more: speak`The figure moves on the clinic's screen. Stop when the exercise is over.` };
    default: return { icon: "walk", title: speak`Recording`, more: speak`Stop when the exercise is over.` };
  }
}

export const REDO = speak`The clinic's screen has Redo: stand still again, then walk. Or go on; the analysis judges the whole take.`;

export const RELOADED = {
  icon: "info", title: speak`This page was loaded again`,
  more: speak`Everything up to then is safe. Connect the same sensors again to go on, or stop here.`,
};

export function sendingRest(heldS) {
  const left = speak`${fixed(heldS, 1)} s are still on this tablet. Keep this page open.`;
  return { icon: "upload", title: speak`Sending the rest`, more: heldS > 0.05 ? left : speak`The server closes the recording.` };
}

// When the take is over: `marked` = count or hash differed, and it was kept all the same.
export function ending(batches, marked) {
  const another = speak`Another recording needs a new code.`;
  if (!batches) return { title: speak`Nothing was recorded`, more: speak`No sensor had sent anything. ${another}` };
  if (marked) {
    return {
      title: speak`Recording is on the server, with a mark`,
      more: speak`Tablet and server did not count the same. Look at the recording on the session's page before you rely on it.`,
    };
  }
  return {
    title: speak`Recording is on the server`,
    more: speak`It is being analysed; the result is on the session's page. ${another}`,
  };
}

export const OTHER_TAB = {
  title: speak`This page is open in another tab`, detail: speak`Go on there, or close it and reload this one.`,
};

export const OTHER_TAKE = {
  title: speak`This code belongs to another recording`,
  detail: speak`Part of the earlier one is still on this tablet only. Save or delete it first.`,
};

export const NOT_THOSE = speak`These are not the sensors this recording began with. Connect the same ones, or stop here.`;

export const loss = (heldS) => speak`${fixed(heldS, 1)} s of the recording are not on the server and cannot be brought back.`;

// Why the socket ended for good.
export function linkProblem({ code, detail }, heldS) {
  const left = heldS > 0.05 ? speak` ${fixed(heldS, 1)} s are still on this tablet only.` : "";
  const save = speak`Save what is left here and tell the person who runs the server.`;
  switch (code) {
    case "token": {
      const how = speak`Ask for a new code on the session's live page and enter it here; recording goes on from where it stopped.`;
      return { title: speak`The pairing is over`, detail: how + left };
    }
    case "ended": {
      const keep = speak`${left.trim()} Save them as a file, which can be uploaded to a session of its own, or delete them.`;
      const detailed = left ? keep : speak`Everything from this tablet is on the server.`;
      return { title: speak`The recording was ended on the clinic's screen`, detail: detailed };
    }
    case "lost": return { title: speak`The server has lost part of this recording`, detail: `${translate(detail)} ${save}` };
    case "replaced": return { title: speak`Another tablet or page took over this recording`, detail: speak`Go on there.${left}` };
    case "finish_mismatch": return { title: speak`Tablet and server do not hold the same`, detail: `${translate(detail)} ${save}` };
    default: return { title: speak`The server refused the recording`, detail: `${translate(detail) || speak`It gave no reason.`}${left}` };
  }
}

export const serverFull = (detail) => ({
  title: speak`The server cannot take data now`, detail: speak`${translate(detail)} It is kept here and sent later.`,
});

export function storageProblem(error) {
  if (error.name === "QuotaExceededError") {
    return {
      title: speak`This tablet's storage is full`,
      detail: speak`Recording goes on, but what is not on the server would be lost by a reload. Keep this page open and bring the network back.`,
    };
  }
  return {
    title: speak`This tablet cannot store data`,
    detail: speak`Keep this page open: a reload would lose what is not on the server yet (${error.message}).`,
  };
}

// Title and sentence for the first worn sensor that does not send.
export function sensorProblem(number, place, sensor, health, running) {
  const silent = sensor.meter.silentS();
  const none = health.text === speak`No data`;
  const got = none ? (silent === null ? speak`received 0` : speak`received 0 for ${Math.round(silent)} s`) : speak`received ${Math.round(health.rateHz)}`;
  const wake = speak`Wake it by moving it, or start without it: what it would measure is then estimated or missing.`;
  const closer = speak`Bring it closer to the tablet; it goes on by itself.`;
  return {
    title: none ? speak`Sensor ${number} on the ${place} sends nothing` : speak`Sensor ${number} on the ${place} sends too slowly`,
    detail: speak`Expected ${Math.round(Math.max(sensor.rateHz, 40))} samples a second, ${got}. ${running ? closer : wake}`,
  };
}

export function hours(value) {
  if (value === null) return speak`this tablet keeps the data until then`;
  if (value > 24) return speak`this tablet keeps more than a day of data`;
  if (value >= 1) return speak`this tablet keeps ${Math.floor(value)} h of data`;
  return speak`this tablet keeps only ${Math.max(1, Math.floor(value * 60))} min of data`;
}

/** @param {number} n */
export const asBefore = (n) => plural(n, speak`As last time: 1 sensor`, speak`As last time: ${n} sensors`);
