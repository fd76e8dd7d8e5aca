// The program under test.

import { execFileSync } from "node:child_process";
import { fileURLToPath } from "node:url";

/** The binary: `POINTMILL`, or what `cargo build` made. */
export const BINARY = process.env.POINTMILL ?? fileURLToPath(new URL("../../../target/debug/pointmill", import.meta.url));

/** Runs pointmill and returns its standard output; its errors are those of this program. */
export const pointmill = (...args) => execFileSync(BINARY, args, { encoding: "utf8", maxBuffer: 2 ** 28, stdio: ["ignore", "pipe", "inherit"] });

/** What `validate --json` prints, also for a dataset that is broken. */
export const validate = (path) => JSON.parse(pointmill("validate", path, "--fast", "--json", "--progress", "none"));

/** What `info --json` says of one dataset. */
export const info = (path) => JSON.parse(pointmill("info", path, "--json"))[0];
