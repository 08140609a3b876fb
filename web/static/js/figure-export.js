// Pictures and videos of the figure, made by the browser from viser's canvas; nothing leaves it but as a file.
import { speak } from "./common/words.js";
const TYPES = ["video/webm;codecs=vp9", "video/webm", "video/mp4"];
const FRAMES = 30; // a second
const LONGEST_MS = 120_000;
const PATIENCE_MS = 10_000;

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

// What is on a WebGL canvas is gone after it was shown, so a frame is taken from its stream: the first that has
// something on it, for a stream may begin with the empty canvas. viser draws only when something changed: `redraw`
// shows the same moment again.
export async function savePicture(canvas, redraw, name) {
  const stream = canvas.captureStream();
  const video = document.createElement("video");
  video.muted = true;
  video.srcObject = stream;
  try {
    const picture = document.createElement("canvas");
    const taken = new Promise((done, fail) => {
      setTimeout(() => fail(new Error(speak`No picture came from the 3D view.`)), PATIENCE_MS);
      const take = () => {
        [picture.width, picture.height] = [video.videoWidth, video.videoHeight];
        const context = picture.getContext("2d");
        context.drawImage(video, 0, 0);
        if (!isEmpty(context.getImageData(0, 0, picture.width, picture.height))) return done();
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
