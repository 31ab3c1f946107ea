import { fileURLToPath } from 'node:url';
import { defineConfig } from 'vite';

const path = (name: string): string => fileURLToPath(new URL(name, import.meta.url));

// <lambent-viewer>: all of it in one file, beside the page.
export default defineConfig({
  root: path('page'),
  build: {
    outDir: path('../build/web'),
    emptyOutDir: false,
    target: 'es2022',
    chunkSizeWarningLimit: 1000,
    modulePreload: { polyfill: false },
    rolldownOptions: { input: path('page/element.ts'), output: { entryFileNames: 'lambent-viewer.js' } },
  },
});
