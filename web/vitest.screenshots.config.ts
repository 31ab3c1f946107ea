import { defineConfig } from 'vitest/config';

export default defineConfig({
  test: {
    include: ['e2e/screenshots.ts'],
    globalSetup: ['e2e/setup.ts'],
    fileParallelism: false,
    hookTimeout: 240_000,
  },
});
