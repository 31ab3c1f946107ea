import { defineConfig } from 'vitest/config';

// One browser and one server at a time: the machine may have two cores and no graphics card. A test takes seconds
// alone, but scripts/test builds beside them.
export default defineConfig({
  test: {
    include: ['e2e/**/*.test.ts'],
    globalSetup: ['e2e/setup.ts'],
    fileParallelism: false,
    testTimeout: 300_000,
    hookTimeout: 300_000,
  },
});
