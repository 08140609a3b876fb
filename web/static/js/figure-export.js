// Pictures and videos of the figure, made by the browser from viser's canvas; nothing leaves it but as a file.
import { speak } from "./common/words.js";
const TYPES = ["video/webm;codecs=vp9", "video/webm", "video/mp4"];
const FRAMES = 30; // a second
const LONGEST_MS = 120_000;
const PATIENCE_MS = 30_000; // software draws a large picture in seconds
const WIDTH = 1600; // px that a saved picture of the figure has at least

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

// Whether a picture is of one colour, as that of a canvas is that was cleared and not drawn on yet.
function isEmpty({ data }) {
  const points = new Uint32Array(data.buffer);
  return points.every((point) => point === points[0]);
}

// viser draws as many pixels as its frame has room for, fewer where drawing is slow. The frame gets the room that a
// picture needs and is scaled back, so that nothing moves on the page.
function enlarge(frame, canvas, { width, height }) {
  const wanted = Math.ceil(((WIDTH + 1) * canvas.clientWidth) / canvas.width);
  if (wanted <= frame.clientWidth) return;
  const size = { width: `${wanted}px`, height: `${Math.round((wanted * height) / width)}px` };
  Object.assign(frame.style, { position: "absolute", inset: "0 auto auto 0", transformOrigin: "0 0", transform: `scale(${width / wanted})`, ...size });
}

// What is on a WebGL canvas is gone after it was shown, so a frame is taken from its stream: the first that has
// something on it, for a stream may begin with the empty canvas. viser draws only when something changed: `redraw`
// shows the same moment again. In a frame it is drawn larger for as long as the picture takes.
export async function savePicture(canvas, redraw, name, frame = null) {
  const size = frame && { width: frame.clientWidth, height: frame.clientHeight };
  const stream = canvas.captureStream();
  const video = document.createElement("video");
  video.muted = true;
  video.srcObject = stream;
  try {
    const picture = document.createElement("canvas");
    const taken = new Promise((done, fail) => {
      setTimeout(() => fail(new Error(speak`The 3D view returned no picture.`)), PATIENCE_MS);
      const take = () => {
        [picture.width, picture.height] = [video.videoWidth, video.videoHeight];
        const context = picture.getContext("2d", { willReadFrequently: true });
        context.drawImage(video, 0, 0);
        if (frame) enlarge(frame, canvas, size); // again where drawing slowed down meanwhile
        const isLarge = !frame || picture.width >= WIDTH;
        if (isLarge && !isEmpty(context.getImageData(0, 0, picture.width, picture.height))) return done();
        video.requestVideoFrameCallback(take);
        redraw();
      };
      video.requestVideoFrameCallback(take);
    });
    redraw();
    video.play();
    await taken;
    save(await new Promise((done) => picture.toBlob(done, "image/png")), name);
  } finally {
    for (const track of stream.getTracks()) track.stop();
    if (frame) frame.style.cssText = "";
  }
}

// Records until stop() of the returned recorder, two minutes at most; `ended` is called when the file is there.
export function recordVideo(canvas, name, ended) {
  const type = TYPES.find((t) => MediaRecorder.isTypeSupported(t));
  const stream = canvas.captureStream(FRAMES);
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: 4_000_000 });
  const chunks = [];
  const longest = setTimeout(() => recorder.stop(), LONGEST_MS);
  recorder.ondataavailable = (e) => chunks.push(e.data);
  recorder.onstop = () => {
    clearTimeout(longest);
    for (const track of stream.getTracks()) track.stop();
    save(new Blob(chunks, { type }), `${name}.${type.includes("mp4") ? "mp4" : "webm"}`);
    ended();
  };
  recorder.start();
  return recorder;
}
