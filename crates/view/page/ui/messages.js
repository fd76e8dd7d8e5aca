// What went wrong, one line each, at the top of the page.

const MOST = 5;

export class Messages {
  constructor(parent) {
    this.parent = parent;
    this.shown = new Set();
  }

  fail(text) {
    this.#show(text, "");
  }

  note(text) {
    this.#show(text, "note");
  }

  #show(text, kind) {
    if (this.shown.has(text) || this.shown.size >= MOST) return;
    this.shown.add(text);
    const line = document.createElement("p");
    line.className = kind;
    line.textContent = text;
    const close = document.createElement("button");
    close.textContent = "×";
    close.title = "Close";
    close.onclick = () => {
      line.remove();
      this.shown.delete(text);
    };
    line.append(close);
    this.parent.append(line);
  }
}
