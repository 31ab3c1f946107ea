// `lambent view`, headless Chromium and what the tests ask of them.
import { spawn, type ChildProcess } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium, type Browser, type Page } from 'playwright-core';
import { createServer, type ViteDevServer } from 'vite';
import { inject } from 'vitest';
import { lambentJson, toolPath } from '../test/tool.ts';

export const haveBrowser = inject('browser') !== '';

/** A connection to the one browser of all tests (setup.ts); closing it closes the pages that were opened by it. */
export async function launch(): Promise<Browser> {
  const browser = await chromium.connect(inject('browser'));
  // Half a minute, which is what pages wait for by themselves, is too little beside a build on two cores.
  const newPage = browser.newPage.bind(browser);
  browser.newPage = async (options) => {
    const page = await newPage(options);
    page.setDefaultTimeout(150_000);
    return page;
  };
  return browser;
}

export interface Server {
  address: string;
  stop(): Promise<number | null>;
}

export function serve(...args: string[]): Promise<Server> {
  const child: ChildProcess = spawn(toolPath, ['view', ...args, '--no-browser', '--json'], {
    stdio: ['ignore', 'pipe', 'pipe'],
  });
  const ended = new Promise<number | null>((resolve) => child.once('exit', resolve));
  return new Promise((resolve, reject) => {
    let text = '',
      errors = '';
    child.stderr!.on('data', (piece: Buffer) => (errors += piece.toString()));
    child.stdout!.on('data', (piece: Buffer) => {
      text += piece.toString();
      const address = /"address": "([^"]*)"/.exec(text)?.[1];
      if (address) resolve({ address, stop: () => (child.kill('SIGINT'), ended) });
    });
    void ended.then((code) => reject(new Error(`view ended with ${code}: ${errors}`)));
  });
}

/** Opens the page at a state, showing light as it is unless that says otherwise; resolves once all is drawn. */
export async function open(
  browser: Browser,
  address: string,
  fragment: string,
  width: number,
  height: number,
): Promise<Page> {
  const page = await browser.newPage({ viewport: { width, height }, deviceScaleFactor: 1 });
  page.on('pageerror', (error) => console.error('page:', error.message));
  await page.goto(`${address}#${fragment}&exposure=0&tone=none`); // the first of a name counts
  await ready(page);
  return page;
}

/** All is loaded and drawn; throws what the page complains of. */
export async function ready(page: Page): Promise<void> {
  await page.waitForSelector('body[data-ready=yes], #problem:not([hidden])', { state: 'attached' });
  const problem = await page.textContent('#problem-text');
  if (problem) throw new Error(`the page says: ${problem}`);
  await drawn(page);
}

/** A program of fixture/, by its page, with files of `folder` under /files/, a tilde for each slash. */
export async function openFixture(
  browser: Browser,
  folder: string,
  name = '',
): Promise<{ page: Page; server: ViteDevServer }> {
  const web = fileURLToPath(new URL('..', import.meta.url));
  const server = await createServer({
    root: join(web, 'e2e/fixture'),
    configFile: false,
    logLevel: 'error',
    cacheDir: fileURLToPath(new URL('../../build/web-tests/fixture-cache', import.meta.url)), // of all folders
    server: { host: '127.0.0.1', port: 0, fs: { allow: [web] }, watch: null, hmr: false },
  });
  await server.listen();
  const page = await browser.newPage();
  page.on('pageerror', (error) => console.error('page:', error.message));
  page.on('console', (message) => {
    if (message.type() === 'error') console.error('page:', message.text());
  });
  await page.route('**/files/*', (route) =>
    route.fulfill({
      body: readFileSync(
        join(
          folder,
          route
            .request()
            .url()
            .replace(/.*\/files\//, '')
            .replaceAll('~', '/'),
        ),
      ),
    }),
  );
  await page.goto(server.resolvedUrls!.local[0]! + name);
  await page.waitForFunction(() => 'scenes' in window || 'gpu' in window);
  return { page, server };
}

/**
 * What the page complains of, on a graphics card that has none of `extensions` and answers `parameters`, by name, with
 * these numbers.
 */
export async function complaint(
  browser: Browser,
  address: string,
  extensions: string[],
  parameters: Record<string, number>,
): Promise<string> {
  const page = await browser.newPage();
  await page.addInitScript(
    ([extensions, parameters]) => {
      interface Context {
        getExtension(name: string): unknown;
        getParameter(name: number): unknown;
      }
      const gl = WebGL2RenderingContext.prototype as unknown as Context & Record<string, number>;
      const real = { extension: Reflect.get(gl, 'getExtension'), parameter: Reflect.get(gl, 'getParameter') };
      const numbers = new Map(
        Object.entries(parameters).map(([name, value]) => [
          (WebGL2RenderingContext as unknown as Record<string, number>)[name],
          value,
        ]),
      );
      gl.getExtension = function (name) {
        return extensions.includes(name) ? null : real.extension.call(this, name);
      };
      gl.getParameter = function (name) {
        return numbers.get(name) ?? real.parameter.call(this, name);
      };
    },
    [extensions, parameters] as const,
  );
  await page.goto(address);
  await page.waitForSelector('body[data-ready=yes], #problem:not([hidden])', { state: 'attached' });
  const text = (await page.isVisible('#problem')) ? (await page.textContent('#problem-text'))! : '';
  await page.close();
  return text;
}

/** Two frames later, what was asked for has been drawn. */
export const drawn = (page: Page): Promise<void> =>
  page.evaluate(
    () =>
      new Promise<void>((resolve) =>
        requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(() => resolve()))),
      ),
  );

export const psnr = (a: string, b: string): number => (lambentJson('compare', a, b) as { psnr: number }).psnr;
