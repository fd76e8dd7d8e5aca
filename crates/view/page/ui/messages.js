// What went wrong, one line each, at the top of the page.

const MOST = 5;

export class Messages {
  constructor(parent) {
    this.parent = parent;
    /** Lines in the order they came; the first ones are shown, the others follow when these are closed. */
    this.lines = [];
  }

  /** An error; a note gives way to it. */
  fail(text) {
    if (this.lines.some((line) => line.text === text)) return;
    const notes = this.lines.filter((line) => line.isNote);
    if (this.lines.length >= MOST && notes.length > 0) this.#take(notes[0]);
    this.lines.push(this.#line(text, false));
    this.#show();
  }

  /** Something to know. A note of a `slot` replaces the one that had it; without room for it, the oldest note goes. */
  note(text, slot) {
    if (this.lines.some((line) => line.text === text)) return;
    const notes = this.lines.filter((line) => line.isNote);
    const former = notes.find((line) => slot && line.slot === slot) ?? (this.lines.length >= MOST ? notes[0] : undefined);
    if (former) this.#take(former);
    this.lines.push(this.#line(text, true, slot));
    this.#show();
  }

  /** It is over: the line goes. */
  remove(text) {
    this.lines.filter((line) => line.text === text).forEach((line) => this.#take(line));
    this.#show();
  }

  #take(line) {
    this.lines = this.lines.filter((each) => each !== line);
  }

  #line(text, isNote, slot) {
    const made = document.createElement("p");
    if (isNote) made.className = "note";
    made.textContent = text;
    const close = document.createElement("button");
    close.textContent = "×";
    close.title = "Close";
    close.onclick = () => this.remove(text);
    made.append(close);
    return { text, isNote, slot, made };
  }

  #show() {
    const shown = this.lines.slice(0, MOST).map((line) => line.made);
    const more = this.lines.length - shown.length;
    if (more > 0) {
      const line = document.createElement("p");
      line.className = "note";
      line.textContent = `and ${more} more`;
      shown.push(line);
    }
    // lines that stay are left alone, so that they are not read out again
    const { parent } = this;
    [...parent.children].filter((each) => !shown.includes(each)).forEach((each) => each.remove());
    shown.forEach((each, i) => parent.children[i] !== each && parent.insertBefore(each, parent.children[i] ?? null));
  }
}
