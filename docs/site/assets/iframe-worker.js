// Browsers start no worker from a file, and the search is one. Opened from disk, it runs in a frame of the page in place of that.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe"), script = document.createElement("script");
      frame.hidden = true;
      document.documentElement.append(frame);
      this.inside = frame.contentWindow;
      this.inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      this.early = []; // messages before the script listens
      script.addEventListener("load", () => { this.early.forEach((data) => this.send(data)); this.early = null; });
      script.src = url;
      frame.contentDocument.head.append(script);
    }
    send(data) { this.inside.dispatchEvent(new MessageEvent("message", { data })); }
    postMessage(data) { if (this.early) this.early.push(data); else this.send(data); }
  };
}
