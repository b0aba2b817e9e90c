// Frames from the server to the viewer. A frame that does not follow the last one is never shown: the server sends a key.
(() => {
  "use strict";
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const [HEAD, KEY, RETRY_MS] = [5, 0, 500];
  const state = document.getElementById("state");
  let shown = 0;
  let centre = null;

  async function inflated(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  /** The frame that a message holds, or null where it does not follow the last one; see codec.py. */
  async function decoded(message, last) {
    const view = new DataView(message);
    const [isKey, number] = [view.getUint8(0) === KEY, view.getUint32(1, true)];
    const data = await inflated(message.slice(HEAD));
    if (!isKey && (!last || number !== last.number + 1)) return null;
    const low = isKey ? new Int32Array(data.slice(0, 12).buffer) : null;
    const ways = isKey ? data.subarray(12) : data;
    const count = ways.length / 2;
    const grid = new Int32Array(count);
    for (let i = 0; i < count; i++) {
      const way = ways[i] | (ways[count + i] << 8);
      grid[i] = isKey ? low[i % 3] + way : last.grid[i] + ((way << 16) >> 16);
    }
    return { number, grid };
  }

  function show(grid) {
    const meshes = [];
    let begin = 0;
    for (const count of scene.live.counts) {
      const end = begin + 3 * count;
      meshes.push(Float32Array.from(grid.subarray(begin, end), (point) => point * scene.live.step));
      begin = end;
    }
    const body = meshes[meshes.length - 1];
    const middle = [0, 0, 0];
    for (let i = 0; i < body.length; i += 3) for (const k of [0, 2]) middle[k] += (3 * body[i + k]) / body.length;
    viewer.place(meshes, middle.map((value, k) => (centre ? value - centre[k] : 0)));
    centre = middle;
  }

  function connect() {
    const socket = new WebSocket(`ws://${location.host}/frames`);
    socket.binaryType = "arraybuffer";
    let last = null; // number and grid points of the last frame
    let turn = Promise.resolve(); // messages are decoded one after the other
    socket.onmessage = (event) => {
      turn = turn.then(async () => {
        const frame = await decoded(event.data, last);
        if (frame) {
          last = frame;
          if (viewer) show(frame.grid);
          shown += 1;
          state.textContent = `live, frame ${frame.number}`;
          document.body.dataset.shown = shown;
        }
        if (socket.readyState === WebSocket.OPEN) socket.send(String(last ? last.number : -1));
      });
    };
    socket.onclose = () => {
      state.textContent = "no connection, trying again";
      setTimeout(connect, RETRY_MS);
    };
  }
  connect();
})();
