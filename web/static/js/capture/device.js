// What the tablet itself gives: a screen that stays on, a tone, room for data, one page at a time.
let lock = null;

async function hold() {
  try {
    lock = await navigator.wakeLock?.request("screen");
  } catch {
    lock = null; // low battery or not visible: asked again when it comes back
  }
}

const again = () => document.visibilityState === "visible" && hold();

// Keep the screen on while recording; tells whether the browser can.
export async function stayAwake(on) {
  document.removeEventListener("visibilitychange", again);
  if (on) {
    document.addEventListener("visibilitychange", again);
    await hold();
  } else {
    await lock?.release();
    lock = null;
  }
  return lock !== null;
}

let audio = null;

// Browsers allow no sound before the first tap: the words say the same.
export function tone(hz = 880, seconds = 0.18) {
  if (navigator.userActivation?.hasBeenActive === false) return;
  try {
    audio ??= new AudioContext();
  } catch {
    return; // no sound here: the words say the same
  }
  const [oscillator, gain] = [audio.createOscillator(), audio.createGain()];
  oscillator.frequency.value = hz;
  gain.gain.setValueAtTime(0.25, audio.currentTime);
  gain.gain.linearRampToValueAtTime(0, audio.currentTime + seconds);
  oscillator.connect(gain).connect(audio.destination);
  oscillator.start();
  oscillator.stop(audio.currentTime + seconds);
}

// Hours of data this tablet can hold, null where the browser does not say.
export async function roomHours(bytesPerSecond) {
  try {
    await navigator.storage.persist?.();
    const { quota, usage } = await navigator.storage.estimate();
    return (quota - usage) / bytesPerSecond / 3600;
  } catch {
    return null;
  }
}

const RELOAD_MS = 1500; // the page before a reload may hold it for a moment

// True when no other tab of this tablet has the page; it stays so until this tab closes.
export function alone() {
  if (!navigator.locks) return Promise.resolve(true);
  return new Promise((answer) => {
    const held = () => {
      answer(true);
      return new Promise(() => {});
    };
    navigator.locks.request("sagittal-capture", { signal: AbortSignal.timeout(RELOAD_MS) }, held).catch(() => answer(false));
  });
}
