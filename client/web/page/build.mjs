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

fs.rmSync('src/gen', { recursive: true, force: true });
fs.mkdirSync('src/gen', { recursive: true });
extractShaders(
  ['shader_sources.h', 'field_source.h'].map(name => path.join(root, 'client/render', name)),
  'src/gen/shaders.ts',
);
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
