// The link to the server: it reconnects by itself, and closes while the page is hidden.
let socket = null, asked = 0, pause = 500, taking = Promise.resolve();
const HIDDEN_MS = 30000;
// The server sends "alive" every 5 s; after this time without a message it counts as gone [ms].
const SILENT_MS = 15000;
let heardAt = 0;
let token = "";

function remembered() {
  if (location.hash.length > 1) {
    token = decodeURIComponent(location.hash.slice(1));
    history.replaceState(null, "", location.pathname);
  }
  try {
    if (token) sessionStorage.setItem("token", token);
    token = token || sessionStorage.getItem("token") || "";
  } catch (error) { /* a browser that keeps nothing: the token is asked for again */ }
}

const send = (message) => socket && socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const wants = () => send({ kind: "wants", field: showsField, unswept: Boolean(model.left) });

// Callbacks of commands that wait for their answer, by number.
const awaited = new Map();

function command(name, members, then = {}) {
  if (!socket || socket.readyState !== WebSocket.OPEN) {
    say("There is no connection: try again.", "bad");
    return;
  }
  asked += 1;
  awaited.set(asked, { ...then, name });
  say("sent …", "");
  send({ kind: "command", id: asked, command: name, ...members });
}

const isLinked = () => find("link").classList.contains("on");
function showLink(on, title) {
  find("link").classList.toggle("on", on);
  find("link").title = title;
  find("link").setAttribute("aria-label", title);
}

function join() {
  const live = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket = live;
  heardAt = Date.now();
  live.binaryType = "arraybuffer";
  live.onopen = () => send({ kind: "hello", token });
  live.onmessage = (event) => {
    heardAt = Date.now();
    taking = taking.then(() => take(event.data)).then(show).catch((error) => console.error(error));
  };
  live.onclose = (event) => socket === live && lose(event.code);
}

function lose(code) {
  socket = null;
  showLink(false, "no connection; trying again");
  if (code === 4401) return;
  showAbsent();
  if (!document.hidden) setTimeout(rejoin, pause);
  pause = Math.min(2 * pause, 8000);
}

setInterval(() => {
  if (!socket || Date.now() - heardAt < SILENT_MS) return;
  socket.close();
  lose(0);
}, 2000);

function rejoin() {
  if (!socket) join();
}

function show(message) {
  switch (message.kind) {
    case "welcome":
      model.role = message.role;
      pause = 500;
      showLink(true, message.role === "operator" ? "connected; may command" : "connected; to look only");
      showAbsent();
      wants();
      showCommands();
      showRooms();
      break;
    case "denied":
      try { sessionStorage.removeItem("token"); } catch (error) { /* nothing was kept */ }
      find("wrong").hidden = message.asks;
      if (!find("login").open) find("login").showModal();
      break;
    case "answer": showAnswer(message); break;
    case "state": showState(); showBars(); break;
    case "events": showEvents(); break;
    case "recording": showRecording(); break;
    case "time": showTime(message); break;
    case "areas": showDrafts(); showPicked(); break;
    case "rooms": showRooms(); break;
    case "shares": showShares(); break;
    case "unswept": showBars(); break;
    case "alive": break;
    default: redraw();
  }
}

find("login").addEventListener("close", () => {
  token = find("token").value.trim();
  find("token").value = "";
  try { sessionStorage.setItem("token", token); } catch (error) { /* it is asked for again */ }
  rejoin();
});

// Opening a link in a tab that shows this page changes only the part after #: take the token from it.
window.addEventListener("hashchange", () => {
  if (location.hash.length < 2) return;
  remembered();
  find("token").value = token;
  if (find("login").open) find("login").close();
  else {
    if (socket) socket.close();
    join();
  }
});

let sleeping = 0;
document.addEventListener("visibilitychange", () => {
  clearTimeout(sleeping);
  if (document.hidden) sleeping = setTimeout(() => socket && socket.close(), HIDDEN_MS);
  else rejoin();
});

readColours();
remembered();
takeUpDrafts();
showDrafts();
redraw();
join();
