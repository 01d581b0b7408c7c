/** How tests are run: one that hangs or fails is told of, and ends. */

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { pathToFileURL } from "node:url";

const folder = mkdtempSync(join(tmpdir(), "tests-"));
after(() => rmSync(folder, { recursive: true }));

function runs(body: string, limit: number): { passed: boolean; told: string } {
  const file = join(folder, "own.mjs");
  writeFileSync(file, `import { test } from "node:test"; test("one", async () => { ${body} });`);
  const runner = pathToFileURL(join("build", "run_files.mjs"));
  const options = `{ together: false, limit: ${limit} }`;
  const program = join(folder, "program.mjs");
  writeFileSync(
    program,
    `import { runFiles } from ${JSON.stringify(runner)};
    process.exit((await runFiles([${JSON.stringify(file)}], ${options})).length);`,
  );
  // Without what tells that it runs within a test already.
  const { NODE_TEST_CONTEXT: _, ...env } = process.env;
  const run = spawnSync(process.execPath, [program], { encoding: "utf8", env, timeout: 60_000 });
  assert.equal(run.stderr, "");
  return { passed: run.status === 0, told: run.stdout };
}

test("a file passes if its tests do, and fails if one of them fails", () => {
  assert.ok(runs("", 30_000).passed);
  const { passed, told } = runs('throw new Error("as it should");', 30_000);
  assert.ok(!passed);
  assert.match(told, /as it should/);
});

test("a file that hangs has failed after its time", () => {
  const { passed, told } = runs("await new Promise((done) => setTimeout(done, 1e8));", 2000);
  assert.ok(!passed);
  assert.match(told, /own\.mjs was ended by SIGTERM, after 2 s at most/);
});
