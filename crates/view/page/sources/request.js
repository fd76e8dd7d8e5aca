// Requests, a few at a time, and errors that say whether they may pass.

/** Browsers open six connections to a server of HTTP/1; all that wait would be one crowd for a server of HTTP/2. */
const MOST_REQUESTS = 8;
/** Statuses of servers, and of what stands before them, that are busy or away. */
const AWAY = [429, 502, 503, 504];

/** It is the connection that failed, not what was requested: that may come later. */
export class Interrupted extends Error {
  isTransient = true;
}

let running = 0;
const waiting = [];

async function place() {
  if (running >= MOST_REQUESTS) await new Promise((next) => waiting.push(next));
  else running++;
}

function leave() {
  const next = waiting.shift();
  if (next) next(); // takes the place over
  else running--;
}

/**
 * An answer with its body: { answer, bytes }. `lost`: what is said if none comes, or not all of it. `accept(answer)` may throw before
 * the body is read.
 */
export async function request(url, { lost, accept, ...options }) {
  const whole = async (promise) => {
    try {
      return await promise;
    } catch (error) {
      throw error.name === "AbortError" ? error : new Interrupted(lost);
    }
  };
  await place();
  try {
    const answer = await whole(fetch(url, options));
    if (AWAY.includes(answer.status)) throw new Interrupted(`${url}: the server answers ${answer.status}`);
    try {
      accept?.(answer);
    } catch (error) {
      await answer.body?.cancel();
      throw error;
    }
    return { answer, bytes: await whole(answer.arrayBuffer()) };
  } finally {
    leave();
  }
}
