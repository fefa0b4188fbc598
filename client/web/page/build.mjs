// Builds the page: node build.mjs SOURCE_ROOT OUT_FOLDER REPLICA_WASM, in the folder that has
// node_modules and src. Writes what trocar-web serves, each file with its compressed twin.
import { build } from 'esbuild';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import path from 'node:path';
import zlib from 'node:zlib';

const [root, out, wasm] = process.argv.slice(2);
if (!wasm) throw new Error('usage: node build.mjs SOURCE_ROOT OUT_FOLDER REPLICA_WASM');

// The native client's own GLSL, so that both pictures look alike.
function extractShaders(headers, to) {
  const text = headers.map(header => fs.readFileSync(header, 'utf8')).join('\n');
  const take = name => {
    const found = text.match(new RegExp(`k${name} = R"\\(([\\s\\S]*?)\\)";`));
    if (!found) throw new Error(`${headers.join(', ')}: no ${name}`);
    return found[1].replace('#version 330 core\n', '');
  };
  const names = [
    'LightingSource',
    'OrganVertexSource',
    'OrganFragmentSource',
    'BackFragmentSource',
    'ToolVertexSource',
    'ToolFragmentSource',
    'FieldVertexSource',
    'FieldFragmentSource',
    'ScopeMaskSource',
  ];
  const lines = names.map(
    name =>
      `export const ${name[0].toLowerCase()}${name.slice(1)} = ${JSON.stringify(take(name))};`,
  );
  fs.writeFileSync(to, lines.join('\n') + '\n');
}

// The table of instruments that the programs bring (common/tool/instruments.toml): tables of keys with
// a text or a number.
function extractInstruments(file, to) {
  const forms = ['plain', 'probe', 'grasper', 'scissors', 'scalpel', 'hook', 'spatula'];
  forms.push('endoscope', 'endoscope-30', 'suction', 'clipper', 'coagulator');
  const tables = fs.readFileSync(file, 'utf8').split('[[instrument]]').slice(1);
  const read = tables.map(table =>
    Object.fromEntries(
      [...table.matchAll(/^(\w+) = (?:"([^"]*)"|([\d.]+))$/gm)].map(m => [
        m[1],
        m[2] ?? Number(m[3]),
      ]),
    ),
  );
  const metres = mm => mm * 1e-3;
  const found = read.map(one => {
    const form = forms.indexOf(one.form);
    if (!one.name || form < 0)
      throw new Error(`${file}: an instrument has no name or no known form`);
    return {
      name: one.name,
      text: one.text ?? '',
      radiusM: metres(one.radius_mm ?? 5),
      lengthM: metres(one.length_mm ?? 300),
      reachM: metres(one.reach_mm ?? 10),
      halfWidthM: metres(one.width_mm ?? 0) / 2,
      friction: one.friction ?? 0.2,
      gripN: one.grip_n ?? 0,
      edgeM: metres(one.edge_mm ?? 0),
      form,
    };
  });
  fs.writeFileSync(to, `export const instruments = ${JSON.stringify(found, null, 1)};\n`);
}

fs.rmSync('src/gen', { recursive: true, force: true });
fs.mkdirSync('src/gen', { recursive: true });
extractShaders(
  ['shader_sources.h', 'field_source.h'].map(name => path.join(root, 'client/render', name)),
  'src/gen/shaders.ts',
);
extractInstruments(path.join(root, 'common/tool/instruments.toml'), 'src/gen/instruments.ts');
execFileSync(
  'protoc',
  [
    `--proto_path=${root}`,
    '--plugin=protoc-gen-es=node_modules/.bin/protoc-gen-es',
    '--es_out=src/gen',
    '--es_opt=target=ts',
    'proto/wire.proto',
    'proto/journal.proto',
    'proto/organ.proto',
    'proto/fine_surface.proto',
  ],
  { stdio: 'inherit' },
);
execFileSync('node_modules/.bin/tsc', ['--noEmit'], { stdio: 'inherit' });
fs.rmSync(out, { recursive: true, force: true });
fs.mkdirSync(out, { recursive: true });
await build({
  entryPoints: { main: 'src/main.tsx' },
  bundle: true,
  minify: true,
  format: 'esm',
  target: 'es2022',
  outdir: out,
  jsx: 'automatic',
  jsxImportSource: 'preact',
  legalComments: 'none',
  logLevel: 'warning',
});
fs.copyFileSync('src/index.html', path.join(out, 'index.html'));
fs.copyFileSync('src/icon.svg', path.join(out, 'icon.svg'));
fs.copyFileSync(wasm, path.join(out, 'replica.wasm'));
let plain = 0,
  packed = 0;
for (const name of fs.readdirSync(out)) {
  const bytes = fs.readFileSync(path.join(out, name)),
    gzip = zlib.gzipSync(bytes, { level: 9 });
  fs.writeFileSync(path.join(out, name + '.gz'), gzip);
  plain += bytes.length;
  packed += gzip.length;
}
console.log(`page: ${plain} bytes, ${packed} compressed`);
