// The waveform of one row of the picture: red, green and blue from left to right, in per cent of what the screen shows as white.

const COLOURS = ["#ff6b5e", "#6fd37a", "#62a3ff"];
const LINES = [0, 25, 50, 75, 100];

// Draws the row (from the top) of a picture's canvas into another canvas.
export function drawWaveform(canvas, picture, row) {
  const { width } = picture;
  const y = Math.max(0, Math.min(picture.height - 1, row));
  const { data } = picture.getContext("2d").getImageData(0, y, width, 1);
  const scale = devicePixelRatio || 1;
  const [w, h] = [canvas.clientWidth * scale, canvas.clientHeight * scale];
  if (!w || !h) return;
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const to = canvas.getContext("2d");
  const left = 26 * scale;
  const level = (share) => h - 5 * scale - share * (h - 10 * scale);
  const style = getComputedStyle(canvas);
  to.clearRect(0, 0, w, h);
  to.font = `${9.5 * scale}px system-ui, "DejaVu Sans", sans-serif`;
  to.textAlign = "right";
  to.textBaseline = "middle";
  for (const line of LINES) {
    to.fillStyle = style.getPropertyValue("--line");
    to.fillRect(left, Math.round(level(line / 100)), w, 1);
    to.fillStyle = style.getPropertyValue("--dim");
    if (line % 50 === 0) to.fillText(`${line}`, left - 4 * scale, level(line / 100));
  }
  // Light adds up on dark, ink on light.
  to.globalCompositeOperation = document.documentElement.dataset.theme === "light" ? "multiply" : "lighter";
  to.lineWidth = scale;
  COLOURS.forEach((colour, channel) => {
    to.strokeStyle = colour;
    to.beginPath();
    for (let x = 0; x < width; x++) {
      const at = left + ((x + 0.5) / width) * (w - left);
      const value = level(data[4 * x + channel] / 255);
      if (x) to.lineTo(at, value);
      else to.moveTo(at, value);
    }
    to.stroke();
  });
  to.globalCompositeOperation = "source-over";
}
