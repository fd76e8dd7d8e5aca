// What went wrong, one line each, at the top of the page.

const MOST = 5;

export class Messages {
  constructor(parent) {
    this.parent = parent;
    /** Lines by their text, the oldest first. */
    this.shown = new Map();
  }

  fail(text) {
    this.#show(text, "");
  }

  note(text) {
    this.#show(text, "note");
  }

  remove(text) {
    this.shown.get(text)?.remove();
    this.shown.delete(text);
  }

  #show(text, kind) {
    if (this.shown.has(text)) return;
    // errors make notes give way; what was told first is the cause
    const [note] = [...this.shown].find(([, line]) => line.className === "note") ?? [];
    if (this.shown.size >= MOST && note !== undefined) this.remove(note);
    if (this.shown.size >= MOST) return;
    const line = document.createElement("p");
    line.className = kind;
    line.textContent = text;
    const close = document.createElement("button");
    close.textContent = "×";
    close.title = "Close";
    close.onclick = () => this.remove(text);
    this.shown.set(text, line);
    line.append(close);
    this.parent.append(line);
  }
}
