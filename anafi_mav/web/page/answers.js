"use strict";

// Requests of a page to its gateway, and what the page shows while they are not answered.

const ANSWER_LIMIT = 3000; // ms; without it the requests of a lost network stay open for minutes

class RefusedRequest extends Error {} // the gateway has answered, for instance that it needs another token

class Answers {
  constructor(path) {
    this.path = path;
    this.receivedAt = performance.now();
  }

  async next() {
    const answer = await fetch(this.path, { signal: AbortSignal.timeout(ANSWER_LIMIT) });
    if (!answer.ok) throw new RefusedRequest(`status ${answer.status}`);
    const value = await answer.json();
    this.receivedAt = performance.now();
    return value;
  }

  // The line above values that are no longer those of the moment.
  missed(error) {
    const age = Math.round((performance.now() - this.receivedAt) / 1000);
    const fault = error instanceof RefusedRequest ? "Requests are refused" : "No answer";
    return `${fault} for ${age} s, the values are of before: ${error.message}`;
  }
}
