// SPDX-License-Identifier: Apache-2.0
// Bundles src/ into ../page/view.js. Its first line says from what, for the test that compares.
import { createHash } from 'node:crypto';
import { readFileSync, readdirSync } from 'node:fs';
import { build } from 'esbuild';

const hash = createHash('sha256');
for (const name of readdirSync('src').sort()) {
  hash.update(name + '\n');
  hash.update(readFileSync('src/' + name));
}
await build({
  entryPoints: ['src/main.ts'],
  outfile: '../page/view.js',
  bundle: true,
  minify: true,
  target: 'es2022',
  format: 'iife',
  charset: 'ascii',
  legalComments: 'none',
  banner: { js: `// SPDX-License-Identifier: Apache-2.0 - built from web/src ${hash.digest('hex')}` },
});
