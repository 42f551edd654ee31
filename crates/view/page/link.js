// The socket: the newest wish goes out, the newest picture comes in; a lost server is looked for again.

const FIRST_WAIT = 500;
const LONGEST_WAIT = 8000;

export class Link {
  // `seen({head, bitmap, blob, latency})`, `told(name, value)`, `state(connected, words)`.
  constructor({ seen, told, state }) {
    Object.assign(this, { seen, told, state });
    this.wait = FIRST_WAIT;
    this.id = 0;
    this.wished = null;
    this.sent = new Map();
    this.lightsSent = this.materialsSent = -1;
    this.arrived = 0;
    this.open();
  }

  open() {
    const address = new URL("socket", location.href.split("#")[0]);
    address.protocol = address.protocol.replace("http", "ws");
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.wait = FIRST_WAIT;
      this.lightsSent = this.materialsSent = -1;
      this.asked = null;
      this.state(true, "Connected");
    };
    socket.onmessage = ({ data }) => (typeof data === "string" ? this.words(data) : this.picture(data));
    socket.onclose = ({ code, reason }) => {
      const ended = code === 1001 ? "relight view has ended. Start it again: what you changed is kept here." : reason;
      this.state(false, ended || "No connection to relight view. Trying again …");
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT);
    };
  }

  get ready() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  words(text) {
    const message = JSON.parse(text);
    for (const [name, value] of Object.entries(message)) this.told(name, value);
  }

  async picture(data) {
    const order = ++this.arrived;
    const length = new DataView(data).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    const blob = new Blob([new Uint8Array(data, 4 + length)], { type: head.format });
    const bitmap = await createImageBitmap(blob);
    // One that came later may be decoded sooner.
    if (order < this.drawn) return bitmap.close();
    this.drawn = order;
    const began = this.sent.get(head.id);
    for (const id of this.sent.keys()) if (id < head.id) this.sent.delete(id);
    this.seen({ head, bitmap, blob, latency: began === undefined ? null : performance.now() - began });
  }

  // Asks for a picture of the state. Returns the number of the wish that asks for it, null if none could be sent.
  show(state, moving) {
    if (!this.ready || !state.hello) return null;
    // A server that can't keep up is not buried.
    if (moving && this.socket.bufferedAmount > 1 << 20) return null;
    // What is shown at rest needs no picture again.
    const picture = moving ? null : JSON.stringify([wishOf(state, 0, false), state.lightsVersion, state.materialsVersion]);
    if (picture !== null && picture === this.asked) return this.wished;
    this.asked = picture;
    this.wished = ++this.id;
    const show = wishOf(state, this.wished, moving);
    if (this.lightsSent !== state.lightsVersion) {
      show.lights = state.shining();
      this.lightsSent = state.lightsVersion;
    }
    if (this.materialsSent !== state.materialsVersion) {
      show.materials = state.materials();
      this.materialsSent = state.materialsVersion;
    }
    this.sent.set(show.id, performance.now());
    if (this.sent.size > 200) this.sent.delete(this.sent.keys().next().value);
    this.socket.send(JSON.stringify({ show }));
    return this.wished;
  }

  // Asks what a place of the picture shows; links: and what brings indirect light there; clusters: and which clusters of lights light it.
  pick(x, y, { links, clusters }) {
    if (this.ready) this.socket.send(JSON.stringify({ pick: { id: ++this.id, x, y, links, clusters } }));
  }
}

export const wishOf = (state, id, moving) => ({
  id,
  moving,
  width: state.size[0],
  height: state.size[1],
  time: state.time,
  // Chosen by the first picture.
  exposure: state.exposure ?? 0,
  tone: state.tone,
  layer: state.layer,
  by: state.by,
  camera: state.eye,
});
