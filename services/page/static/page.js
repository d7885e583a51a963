// Shows what the stream /events tells, and sends what a person does. Without it the STOP button still works: it is a form.
"use strict";
const byId = (id) => document.getElementById(id);
const words = JSON.parse(byId("words").textContent);
const LOST_MS = 9000; // three beats of the stream (services/page/app.py)
const AGAIN_MS = 1500;
const ANSWER_MS = 60000; // an answer is shown so long (estimate); later it may not be true any more
const NEWEST = 5; // ended tasks that are always shown (estimate); the others are behind "Earlier today"
const ASKED_MS = 30000; // a question is open so long (services/human_interface/memory.py); later, its No would stop the robot
const fill = (text, part) => text.replace("{}", part);
const upper = (text) => text.charAt(0).toUpperCase() + text.slice(1);

// --- the stream ----------------------------------------------------------------------------------------------------------

let source = null;
let beat = 0;
let shown = {};
let large = "room"; // the picture that is large, and new several times a second while the robot moves
const trueAt = {}; // when a picture was true [ms of the page's clock]
let ahead = 0; // the page's clock of this one

function listen() {
  if (source) source.close();
  source = new EventSource("/events?" + new URLSearchParams({ language: words.language, large }));
  for (const name of ["view", "picture", "room", "beat", "bye"]) source.addEventListener(name, () => (beat = Date.now()));
  source.addEventListener("view", (event) => show(JSON.parse(event.data)));
  source.addEventListener("picture", (event) => picture("picture", JSON.parse(event.data)));
  source.addEventListener("room", (event) => picture("room", JSON.parse(event.data)));
  source.addEventListener("clock", (event) => (ahead = Number(event.data) - Date.now()));
  source.addEventListener("true", (event) => { const { name, at } = JSON.parse(event.data); trueAt[name] = at; ages(); });
  source.onopen = () => { beat = Date.now(); lost(false); };
  source.onerror = async () => {
    lost(true);
    if (source.readyState !== EventSource.CLOSED) return; // it comes back by itself
    const known = await fetch("/static/page.js", { method: "HEAD" }).catch(() => null);
    if (known && known.status === 401) location.reload(); // to the door
  };
}

function lost(yes) {
  set("lost", yes ? words.lost : "");
  document.body.classList.toggle("is-lost", yes);
}

setInterval(() => {
  if (document.hidden) return;
  const silent = Date.now() - beat > LOST_MS;
  if (silent) lost(true);
  if (silent || source.readyState === EventSource.CLOSED) { beat = Date.now() - LOST_MS / 2; listen(); }
}, AGAIN_MS);

// A browser opens six streams to a host at most: tabs that nobody looks at have none.
document.addEventListener("visibilitychange", () => {
  if (document.hidden) source.close();
  else listen();
});

// --- what is shown -------------------------------------------------------------------------------------------------------

// Set a text only where it changes, so that screen readers say it once.
function set(id, text, lang) {
  const place = byId(id);
  if (place.textContent !== text) place.textContent = text;
  if (lang) place.lang = lang;
  place.hidden = !text && !place.hasAttribute("role");
}

function show(view) {
  const before = shown;
  shown = view;
  set("now", view.now);
  set("please", view.please);
  set("step", view.step);
  set("next", view.next);
  set("why", view.active ? view.active.why : "");
  set("hands", view.hands);
  set("last", view.told.last);
  part("now-acts", view.active, before.active, () => (view.active ? [...goOn(view.active), cancelButton(view.active)] : []));
  part("queue", view.queue, before.queue, () => view.queue.map(waiting));
  part("ended", view.ended, before.ended, () => view.ended.slice(0, NEWEST).map(ended));
  part("earlier-list", view.ended, before.ended, () => view.ended.slice(NEWEST).map(ended));
  byId("earlier").hidden = view.ended.length <= NEWEST;
  part("alone", view.alone, before.alone, () => view.alone.map(sayButton));
  part("things", view.things, before.things, () => view.things.map(thing));
  byId("queue-empty").hidden = view.queue.length > 0;
  byId("nothing-seen").hidden = view.things.length > 0;
  byId("release-form").hidden = !view.held;
  document.body.classList.toggle("is-held", view.held);
  document.body.classList.toggle("is-active", Boolean(view.active) && !view.held);
  document.body.classList.toggle("is-away", !view.hi);
  if (before.told && view.told.n > before.told.n) {
    speak(view.told.text);
    if (view.told.text === view.told.last) notify(view.told.text);
  }
  if (before.active && !view.active) answer(view.told.text);
  times();
  if (view.please && view.please !== before.please) speak(view.please);
  if (before.told) describe();
}

// Fill a part of the page where it has changed; who was on a button in it stays on it.
function part(id, now, before, make) {
  if (JSON.stringify(now) === JSON.stringify(before)) return;
  const place = byId(id);
  const on = place.contains(document.activeElement) ? document.activeElement.dataset.key : "";
  place.replaceChildren(...make());
  if (on) (place.querySelector(`[data-key="${CSS.escape(on)}"]`) || byId("text")).focus();
}

// --- times, which go on while nothing is told ------------------------------------------------------------------------------

const clock = (unix) => new Date(1000 * unix).toLocaleTimeString(words.language, { hour: "2-digit", minute: "2-digit", hourCycle: "h23" });

// A time until then: to ten seconds, from two minutes on to a minute.
function span(unix) {
  const seconds = Math.max(10, 10 * Math.round((unix - Date.now() / 1000) / 10));
  return seconds < 120 ? [seconds, "second"] : [Math.round(seconds / 60), "minute"];
}

function lasting(unix) {
  const [value, unit] = span(unix);
  return new Intl.NumberFormat(words.language, { style: "unit", unit, unitDisplay: "long" }).format(value);
}

function inTime(unix) {
  const [value, unit] = span(unix);
  const text = new Intl.RelativeTimeFormat(words.language).format(value, unit);
  return `${text} (${clock(unix)})`;
}

const isAhead = (unix) => unix > Date.now() / 1000;

function times() {
  const active = shown.active;
  const left = active && !shown.held && isAhead(active.until) ? words.left.replace("{0}", lasting(active.until)).replace("{1}", clock(active.until)) : "";
  set("left", left);
  const step = active && shown.step && !shown.held ? shown.step : "";
  set("bar", [shown.now, step, left, active ? "" : shown.told.last].filter(Boolean).map((text) => text.replace(/\.$/, "")).join(" · "));
  for (const place of document.querySelectorAll("[data-begins]")) {
    const begins = Number(place.dataset.begins);
    place.textContent = isAhead(begins) ? fill(words.begins, inTime(begins)) : "";
  }
}

setInterval(() => { if (!document.hidden && shown.now) times(); }, 5000);

function element(name, text, properties = {}) {
  const made = Object.assign(document.createElement(name), properties);
  if (text) made.textContent = text;
  return made;
}

function button(text, key, label, act) {
  const made = element("button", text, { type: "button" });
  made.dataset.key = key;
  if (label) made.setAttribute("aria-label", label);
  made.addEventListener("click", () => act(made));
  return made;
}

function goOn(task) {
  if (!task.asks) return [];
  const made = button(words.go_on, "go " + task.asks, fill(words.go_on_of, task.asks_says), () => send("/step", { at: task.asks }));
  made.className = "main";
  return [made];
}

const cancelButton = (task) =>
  button(words.cancel, "cancel " + task.task, fill(words.cancel_of, task.says), () => send("/cancel", { task: task.task }));

function waiting(task, place) {
  const item = element("li");
  const until = task.deadline && fill(words.deadline, clock(task.deadline));
  const notes = [task.word, task.note, until].filter(Boolean).join(", ");
  item.append(element("span", upper(task.says), { className: "says" }), element("span", notes, { className: "hint" }));
  const begins = task.start || (place === 0 && shown.active ? shown.active.until : 0);
  if (begins) {
    const when = element("span", "", { className: "hint" });
    when.dataset.begins = begins;
    item.append(when);
  }
  if (task.why) item.append(element("span", task.why, { className: "hint" }));
  const acts = element("span", "", { className: "acts" });
  if (place > 0 || shown.active)
    acts.append(button(words.do_first, "first " + task.task, fill(words.do_first_of, task.says), () => send("/first", { task: task.task })));
  acts.append(cancelButton(task));
  item.append(acts);
  return item;
}

function ended(task) {
  const item = element("li", "", { className: task.state });
  const at = element("span", clock(task.since), { className: "hint" });
  item.append(element("span", upper(task.says), { className: "says" }), element("span", task.word, { className: "word" }), at);
  if (task.why) item.append(element("span", task.why, { className: "why" }));
  if (task.unchecked) item.append(element("span", task.unchecked, { className: "why" }));
  if (task.again) {
    const acts = element("span", "", { className: "acts" });
    acts.append(button(words.again, "again " + task.task, fill(words.again_of, task.says), () => say(task.again)));
    item.append(acts);
  }
  return item;
}

const sayButton = (says) => button(upper(says), "say " + says, "", () => say(says));

function thing(one) {
  const group = element("div", "", { className: "thing" });
  group.setAttribute("role", "group");
  group.setAttribute("aria-label", one.thing);
  group.append(element("h3", upper(one.thing)));
  const acts = element("p", "", { className: "acts" });
  acts.append(...one.says.map(sayButton));
  group.append(acts);
  return group;
}

const OLD_MS = 1500; // of a picture; while the robot moves the next one comes sooner
const figures = [...document.querySelectorAll("figure[data-of]")];

function picture(name, data) {
  const place = byId(name);
  place.src = data;
  place.hidden = place.closest("figure").hidden = false;
  if (name === "picture") byId("no-picture").hidden = true;
  describe();
}

function describe() {
  const text = fill(words.picture_text, shown.step || shown.now || "").trim();
  if (byId("picture").alt !== text) byId("picture").alt = text;
  if (byId("enlarged").hidden) return;
  const { src, alt } = byId(large);
  if (byId("enlarged-picture").src !== src) byId("enlarged-picture").src = src;
  if (byId("enlarged-picture").alt !== alt) byId("enlarged-picture").alt = alt;
  const moves = shown.active && !shown.active.asks && !shown.held;
  set("caption", shown.please || (moves && shown.step) || shown.now || "");
}

function ages() {
  for (const place of document.querySelectorAll(".age")) {
    const ms = Date.now() + ahead - trueAt[place.parentNode.dataset.of || large];
    const s = Math.round(ms / 1000);
    const text = ms > OLD_MS ? (s < 120 ? fill(words.ago_s, s) : fill(words.ago_min, Math.floor(s / 60))) : "";
    if (place.textContent !== text) place.textContent = text;
    place.hidden = !text;
  }
}
setInterval(ages, 500);

// The page behind an enlarged picture is out of reach, STOP is not; Escape is STOP here, too, so it does not close it.
function enlarge(yes) {
  for (const part of [document.querySelector("header"), byId("main")]) part.inert = yes;
  document.body.classList.toggle("is-enlarged", yes);
  byId("enlarged").hidden = !yes;
  describe();
  ages();
  (yes ? byId("reduce") : byId(large).closest("button")).focus();
}

new ResizeObserver(() => (byId("enlarged").style.bottom = byId("stopbar").offsetHeight + "px")).observe(byId("stopbar"));

function makeLarge(name) {
  large = name;
  for (const figure of figures) {
    const is = figure.dataset.of === large;
    figure.classList.toggle("large", is);
    figure.querySelector(".tag").textContent = is ? words.enlarge : words.show_large;
  }
  listen();
}

for (const figure of figures)
  figure.querySelector("button").addEventListener("click", () => {
    if (figure.dataset.of === large) enlarge(true);
    else makeLarge(figure.dataset.of);
  });
for (const id of ["reduce", "enlarged-picture"]) byId(id).addEventListener("click", () => enlarge(false));

// --- what a person does --------------------------------------------------------------------------------------------------

const order = () => ({ ...(byId("first").checked ? { first: "1" } : {}), ...(byId("careful").checked ? { careful: "1" } : {}) });
const say = (text) => send("/say", { text, ...order() });

byId("careful").checked = localStorage.getItem("careful") === "1";
byId("careful").addEventListener("change", (event) => localStorage.setItem("careful", event.target.checked ? "1" : "0"));

let sent = 0; // requests so far
let replied = 0; // number of the newest request that has its reply; later replies to older requests are dropped, unless they are errors

async function send(path, fields = {}) {
  const number = ++sent;
  let reply;
  try {
    const answer = await fetch(path, { method: "POST", body: new URLSearchParams({ ...fields, east_min: -new Date().getTimezoneOffset() }), headers: { Accept: "application/json" } });
    if (answer.status === 401) return location.reload();
    reply = answer.headers.get("content-type").includes("json") ? await answer.json() : { error: answer.status === 429 ? words.too_often : "" };
  } catch {
    reply = { error: words.unreached };
  }
  if (reply.error || number > replied) answered(reply);
  replied = Math.max(replied, number);
  return !reply.error;
}

let asked = 0;
let told = 0;

function answer(text) {
  clearTimeout(told);
  set("answer", text);
  told = setTimeout(() => { set("answer", ""); byId("answer").classList.remove("alarm"); }, ANSWER_MS);
}

function answered(reply) {
  clearTimeout(asked);
  const text = reply.error ? fill(words.failed, reply.error) : reply.state === "question" ? fill(words.asks, reply.text) : reply.text;
  answer(text);
  byId("answer").classList.toggle("alarm", Boolean(reply.error));
  byId("replies").replaceChildren(...(reply.replies || []).map((says) => button(upper(says), "say " + says, "", () => send("/say", { text: says }))));
  if (reply.replies && reply.replies.length) {
    byId("replies").firstChild.focus();
    asked = setTimeout(() => byId("replies").replaceChildren(), ASKED_MS);
  }
  if (text) speak(text);
}

byId("say-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const text = byId("text").value.trim();
  if (!text) return;
  const sent = await say(text);
  if (!sent || byId("text").value.trim() !== text) return; // the next sentence may be there by now
  byId("text").value = "";
  byId("first").checked = false;
});
byId("release-form").addEventListener("submit", (event) => {
  event.preventDefault();
  send("/release").then(() => byId("stop").focus());
});
byId("stop-form").addEventListener("submit", (event) => {
  event.preventDefault();
  stop();
});
addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !event.repeat) stop();
});

async function stop() {
  document.body.classList.add("is-stopping");
  for (let tries = 0; tries < 3 && !(await send("/stop")); tries += 1) await new Promise((done) => setTimeout(done, 300));
  document.body.classList.remove("is-stopping");
}

// --- voice ---------------------------------------------------------------------------------------------------------------

let speaking = false;
const audio = byId("voice-audio");
const ownVoice = () => ("speechSynthesis" in window ? speechSynthesis.getVoices().find((one) => one.lang.startsWith(words.language)) : null);

function voices() {
  byId("voice").hidden = !(words.voice || ownVoice());
}

function speak(text) {
  if (!speaking || !text) return;
  if (words.voice) {
    audio.src = "/speech?" + new URLSearchParams({ text: text.slice(0, 400), language: words.language });
    audio.play().catch(() => {});
  } else if (ownVoice()) {
    speechSynthesis.cancel();
    speechSynthesis.speak(Object.assign(new SpeechSynthesisUtterance(text), { voice: ownVoice(), lang: words.language }));
  }
}

byId("voice").addEventListener("click", () => {
  speaking = !speaking;
  byId("voice").setAttribute("aria-pressed", String(speaking));
  if (speaking) speak(shown.now);
  else { audio.pause(); if ("speechSynthesis" in window) speechSynthesis.cancel(); }
});
if ("speechSynthesis" in window) speechSynthesis.addEventListener("voiceschanged", voices);
voices();

// --- a notification and a sound when a task has ended -----------------------------------------------------------------------

let telling = false;
let sound = null;

function notify(text) {
  if (!telling) return;
  chime();
  if ("Notification" in window && Notification.permission === "granted" && document.hidden) new Notification(words.title, { body: text, icon: "/static/icon.svg" });
}

// Two notes, the second one higher.
function chime() {
  sound = sound || new AudioContext();
  for (const [at, hertz] of [[0, 660], [0.18, 880]]) {
    const note = new OscillatorNode(sound, { frequency: hertz });
    const gain = new GainNode(sound, { gain: 0.2 });
    note.connect(gain).connect(sound.destination);
    note.start(sound.currentTime + at);
    note.stop(sound.currentTime + at + 0.16);
  }
}

byId("notify").addEventListener("click", () => {
  telling = !telling;
  byId("notify").setAttribute("aria-pressed", String(telling));
  if (!telling) return;
  chime();
  if ("Notification" in window && Notification.permission === "default") Notification.requestPermission().catch(() => {});
});

// Only where the browser can hear; what it heard is shown, and nothing moves before it is sent by hand.
const Recognition = window.SpeechRecognition || window.webkitSpeechRecognition;
if (Recognition) {
  byId("microphone").hidden = false;
  byId("microphone").addEventListener("click", () => {
    const hears = Object.assign(new Recognition(), { lang: words.language, interimResults: false, maxAlternatives: 1 });
    hears.onresult = (event) => {
      byId("text").value = event.results[0][0].transcript;
      set("answer", words.heard);
      byId("send").focus();
    };
    hears.onerror = (event) => {
      if (event.error === "no-speech" || event.error === "aborted") return;
      byId("microphone").hidden = true;
      set("answer", words.not_heard);
      byId("text").focus();
    };
    set("answer", words.hearing);
    hears.start();
  });
}

listen();
