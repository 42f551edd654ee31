// Path tracing beside the asset's picture: a second canvas over the first, right of a divider that can be dragged.

const percent = (share) => `${(100 * share).toFixed(share < 0.0995 ? 1 : 0)} %`;
const signed = (share) => `${share < 0 ? "−" : "+"}${percent(Math.abs(share))}`;

export class Beside {
  constructor(state, stage) {
    Object.assign(this, { state, frame: stage, at: 0.5, shown: null });
    this.canvas = stage.querySelector("#reference");
    this.bar = stage.querySelector("#divider");
    this.words = stage.querySelector("#apart");
    this.bar.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      event.stopPropagation();
      this.bar.setPointerCapture(event.pointerId);
      this.bar.focus({ preventScroll: true });
      this.held = true;
    });
    this.bar.addEventListener("pointermove", (event) => {
      if (!this.held) return;
      const rect = this.canvas.getBoundingClientRect();
      if (rect.width) this.move((event.clientX - rect.left) / rect.width);
    });
    for (const name of ["pointerup", "pointercancel"]) this.bar.addEventListener(name, () => (this.held = false));
    this.bar.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      this.move(this.at + step);
    });
  }

  get on() {
    return this.state.by === "both";
  }

  move(at) {
    this.at = Math.max(0, Math.min(1, at));
    this.place(this.box);
  }

  // A pass has come.
  draw(bitmap, { apart }) {
    [this.canvas.width, this.canvas.height] = [bitmap.width, bitmap.height];
    this.canvas.getContext("2d").drawImage(bitmap, 0, 0);
    this.shown = true;
    const samples = `${apart?.samples ?? 0} sample${apart?.samples === 1 ? "" : "s"} a pixel`;
    if (!apart) this.words.textContent = "Path traced; the two can't be compared";
    else if (apart.noise === null) this.words.textContent = `Path traced, ${samples}`;
    else if (apart.error < 0.5 * apart.noise) this.words.textContent = `Path traced, ${samples} · differs by less than its noise of ${percent(apart.noise)} · mean ${signed(apart.bias)}`;
    else this.words.textContent = `Path traced, ${samples} · differs by ${percent(apart.error)}, noise ${percent(apart.noise)} · mean ${signed(apart.bias)}`;
    this.words.title = "√relMSE of the relit picture against path tracing, less the noise of path tracing, which is told beside it; mean: how much brighter the relit picture is in all";
    this.place(this.box);
  }

  // The picture changes: what was traced is of another one.
  stale() {
    if (!this.on) this.words.textContent = "";
    else this.words.textContent = "Path tracing begins once nothing moves";
    this.shown = null;
    this.place(this.box);
  }

  place(box) {
    if (!box) return;
    this.box = box;
    const seen = this.on && this.shown;
    this.canvas.hidden = !seen;
    this.bar.hidden = !this.on;
    this.words.hidden = !this.on;
    const share = (100 * this.at).toFixed(2);
    this.canvas.style.clipPath = `inset(0 0 0 ${share}%)`;
    Object.assign(this.bar.style, { left: `${box.x + box.width * this.at}px`, top: `${box.y}px`, height: `${box.height}px` });
    Object.assign(this.words.style, { left: `${box.x + box.width / 2}px`, top: `${box.y + 8}px` });
    this.bar.setAttribute("aria-valuenow", String(Math.round(100 * this.at)));
    for (const side of ["left", "top", "width", "height"]) this.canvas.style[side] = `${{ left: box.x, top: box.y, width: box.width, height: box.height }[side]}px`;
  }
}
