// An organ with a fine surface and a picture on it, for tests of the page: the built-in liver's own mesh,
// its surface divided and made bumpy, painted with squares.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import zlib from 'node:zlib';

const { TROCAR_BUILD } = process.env;
export const kSquares = 16, kBumpM = 0.0004;

function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = crc & 1 ? 0xedb88320 ^ (crc >>> 1) : crc >>> 1;
  }
  return ~crc >>> 0;
}
// A PNG file; `pixel`: red, green and blue at a place.
export function png(side, pixel) {
  const rows = Buffer.alloc(side * (side * 3 + 1));
  for (let y = 0; y < side; y++) for (let x = 0; x < side; x++) rows.set(pixel(x, y), y * (side * 3 + 1) + 1 + x * 3);
  const chunk = (type, data) => {
    const out = Buffer.alloc(12 + data.length);
    out.writeUInt32BE(data.length, 0);
    out.write(type, 4, 'latin1');
    data.copy(out, 8);
    out.writeUInt32BE(crc32(out.subarray(4, 8 + data.length)), 8 + data.length);
    return out;
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(side, 0);
  head.writeUInt32BE(side, 4);
  head.set([8, 2, 0, 0, 0], 8);
  return Buffer.concat([Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), chunk('IHDR', head), chunk('IDAT', zlib.deflateSync(rows)), chunk('IEND', Buffer.alloc(0))]);
}

// Corners of a binary STL file, each place once.
function readStl(file) {
  const bytes = fs.readFileSync(file), count = bytes.readUInt32LE(80), places = new Map(), positions = [], triangles = [];
  for (let t = 0; t < count; t++) {
    const corners = [0, 1, 2].map(k => {
      const at = [0, 1, 2].map(axis => bytes.readFloatLE(84 + t * 50 + 12 + k * 12 + axis * 4)), key = at.join();
      if (!places.has(key)) places.set(key, positions.push(at) - 1);
      return places.get(key);
    });
    triangles.push(corners);
  }
  return { positions, triangles };
}
// Each triangle becomes four.
function divided({ positions, triangles }) {
  const middles = new Map(), out = [...positions], finer = [];
  const middle = (a, b) => {
    const key = a < b ? `${a} ${b}` : `${b} ${a}`;
    if (!middles.has(key)) middles.set(key, out.push(out[a].map((c, axis) => (c + out[b][axis]) / 2)) - 1);
    return middles.get(key);
  };
  for (const [a, b, c] of triangles) {
    const ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    finer.push([a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]);
  }
  return { positions: out, triangles: finer };
}

// Makes FOLDER/painted.organ; `divisions`: how often each triangle becomes four. Returns its path and how
// many triangles its fine surface has.
export function makeOrgan(folder, divisions = 2) {
  const organ = (...args) => execFileSync(`${TROCAR_BUILD}/bin/trocar-organ`, args, { stdio: ['ignore', 'pipe', 'pipe'] });
  organ('export', 'liver', '--out', `${folder}/liver.stl`);
  organ('export', 'liver', '--out', `${folder}/liver.msh`);
  let fine = readStl(`${folder}/liver.stl`);
  for (let i = 0; i < divisions; i++) fine = divided(fine);
  const [low, high] = [Math.min, Math.max].map(pick => [0, 1].map(axis => fine.positions.reduce((best, p) => pick(best, p[axis]), fine.positions[0][axis])));
  const lines = [];
  for (const [x, y, z] of fine.positions) lines.push(`v ${x} ${y} ${z + kBumpM * Math.sin(1500 * x) * Math.sin(1500 * y)}`);
  for (const p of fine.positions) lines.push(`vt ${[0, 1].map(axis => (p[axis] - low[axis]) / (high[axis] - low[axis])).join(' ')}`);
  for (const corners of fine.triangles) lines.push(`f ${corners.map(v => `${v + 1}/${v + 1}`).join(' ')}`);
  fs.writeFileSync(`${folder}/fine.obj`, lines.join('\n') + '\n');
  fs.writeFileSync(`${folder}/squares.png`, png(256, (x, y) => ((x * kSquares >> 8) + (y * kSquares >> 8)) % 2 === 0 ? [210, 90, 70] : [60, 110, 200]));
  organ('import', `${folder}/liver.msh`, '--material', 'human_liver_nava2008', '--embed', `${folder}/fine.obj`, '--embed-picture', `${folder}/squares.png`, '--out', `${folder}/painted.organ`);
  assert.ok(fs.existsSync(`${folder}/painted.organ`));
  return { path: `${folder}/painted.organ`, triangles: fine.triangles.length };
}
