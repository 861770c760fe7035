// Server-sent events that survive a restart of the server: reconnects by itself and says when it is away.

import { API } from "./api.js";

/** Listen to a stream. `on(name, data)` for every event, `onLink(true|false)` when the link comes or goes. Returns the end. */
export function listen(path, names, on, onLink = () => {}) {
  let source = null;
  let timer = null;
  let closed = false;
  let wait = 500;

  function open() {
    source = new EventSource(`${API}${path}`);
    source.onopen = () => { wait = 500; onLink(true); };
    const heard = (event) => {
      let data = null;
      try { data = JSON.parse(event.data); } catch { return; }
      on(event.type, data);
    };
    source.onmessage = heard;
    for (const name of names) source.addEventListener(name, heard);
    source.onerror = () => {
      onLink(false);
      source.close();
      if (closed) return;
      timer = setTimeout(open, wait);
      wait = Math.min(wait * 1.6, 5000);
    };
  }

  open();
  return () => { closed = true; clearTimeout(timer); source?.close(); };
}
