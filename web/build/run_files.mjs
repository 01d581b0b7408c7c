/** Runs files of tests, each for a time at most: what hangs must not hang who waits for it. */

import { spawn } from "node:child_process";
import { once } from "node:events";
import { availableParallelism } from "node:os";
import { setTimeout as sleep } from "node:timers/promises";

/** Time that what a file has told last may take on its way, ms. */
const PATIENCE = 1000;

/**
 * Runs them, and tells what comes of them.
 *
 * @param files Paths.
 * @param together Whether they may run at the same time; each is then told of once it has ended.
 * @param limit Longest time of a file, ms. One that has not ended by then gets a SIGTERM, by which
 *   it ends its browser, too, and has failed. (node's own limits are for a test in some versions and
 *   for a file in others.)
 * @returns Those that failed.
 */
export async function runFiles(files, { together, limit }) {
  const waiting = [...files];
  const failed = [];
  const work = async () => {
    for (let file = waiting.shift(); file !== undefined; file = waiting.shift()) {
      const parts = [];
      const tell = together ? (text) => parts.push(text) : (text) => process.stdout.write(text);
      if (!(await runFile(file, limit, tell))) failed.push(file);
      process.stdout.write(parts.join(""));
    }
  };
  await Promise.all(Array.from({ length: together ? availableParallelism() : 1 }, work));
  return failed;
}

/** Returns whether a file passed. */
async function runFile(file, limit, tell) {
  const words = ["--enable-source-maps", "--test-reporter=spec", file];
  const stdio = ["ignore", "pipe", "pipe"];
  const program = spawn(process.execPath, words, { stdio, timeout: limit });
  const closed = once(program, "close");
  tell(`${file}\n`);
  for (const stream of [program.stdout, program.stderr]) stream.setEncoding("utf8").on("data", tell);
  const [status, signal] = await once(program, "exit");
  // Not for ever: what it left running may keep its output open.
  await Promise.race([closed, sleep(PATIENCE, undefined, { ref: false })]);
  if (signal) tell(`${file} was ended by ${signal}, after ${limit / 1000} s at most\n`);
  return status === 0;
}
