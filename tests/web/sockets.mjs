// Somebody at the page's socket without a page, who says what they like.
import { until, world } from './browser.mjs';

export const kGoodbye = 22, kWelcome = 17, kFrame = 2, kGuestMessage = 60;
// Varints of a tag with a length, as an Envelope begins.
export const envelope = (field, ...body) => new Uint8Array([...(field < 16 ? [field << 3 | 2] : [(field << 3 | 2) & 0x7f | 0x80, field >> 4]), body.length, ...body]);
const fieldOf = bytes => (bytes[0] < 0x80 ? bytes[0] : (bytes[0] & 0x7f) | (bytes[1] << 7)) >> 3;

// Somebody who watches without a page, and acknowledges each frame.
export class Watcher {
  frames = 0;
  isOpen = false;
  isClosed = false;
  goodbye = '';
  isWelcome = false;
  constructor(join, web = world.web) {
    this.socket = new WebSocket(`ws://127.0.0.1:${web.port}/session`, { headers: { origin: `http://127.0.0.1:${web.port}` } });
    this.socket.binaryType = 'arraybuffer';
    this.socket.onopen = () => { this.isOpen = true; if (join) this.socket.send(JSON.stringify({ role: 'observer', ...join })); };
    this.socket.onclose = () => { this.isClosed = true; };
    this.socket.onerror = () => undefined;
    this.socket.onmessage = event => this.take(new Uint8Array(event.data));
  }
  take(bytes) {
    const field = fieldOf(bytes);
    if (field === kWelcome) {
      this.isWelcome = true;
      this.token = Buffer.from(bytes).toString('hex').match(/a20110(.{32})/)?.[1]; // return_token
    }
    if (field === kGoodbye) this.goodbye = new TextDecoder().decode(bytes);
    if (field !== kFrame) return;
    this.frames++;
    let at = 1;
    while (bytes[at++] >= 0x80);
    const number = [];
    if (bytes[at++] === 8) do number.push(bytes[at]); while (bytes[at++] >= 0x80);
    if (this.socket.readyState === 1) this.socket.send(envelope(4, 8, ...number));
  }
  send(bytes) { this.socket.send(bytes); }
  async joined() { await until('a welcome', () => this.isWelcome || this.isClosed || this.goodbye !== ''); return this; }
  close() { this.socket.close(); }
}
export const join = (name, code = world.server.codes.observer, web = world.web) => new Watcher({ name, code }, web).joined();
export const grows = async (watcher, count = 30) => {
  const before = watcher.frames;
  await until('frames', () => watcher.frames >= before + count);
};
