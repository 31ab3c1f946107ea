import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vite';

// The page. Paths are relative, so that it works from any folder of any host.
export default defineConfig({
  root: fileURLToPath(new URL('page', import.meta.url)),
  base: './',
  build: {
    outDir: fileURLToPath(new URL('../build/web', import.meta.url)),
    emptyOutDir: true,
    target: 'es2022',
    chunkSizeWarningLimit: 1000,
    modulePreload: { polyfill: false },
  },
});
