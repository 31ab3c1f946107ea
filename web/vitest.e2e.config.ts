import { defineConfig } from 'vitest/config';

// One browser and one server at a time: the machine may have two cores and no graphics card.
export default defineConfig({
  test: { include: ['e2e/**/*.test.ts'], fileParallelism: false, testTimeout: 120_000, hookTimeout: 240_000 },
});
