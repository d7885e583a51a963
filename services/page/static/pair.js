// Takes the code of the address's fragment, which no log has, and pairs this browser with it.
"use strict";
const form = document.getElementById("pair-form");
const answer = document.getElementById("answer");
const words = JSON.parse(document.getElementById("words").textContent);

async function pair() {
  try {
    const reply = await fetch("/pair", { method: "POST", body: new URLSearchParams(new FormData(form)), headers: { Accept: "application/json" } });
    if (reply.ok) location.replace("/");
    else answer.textContent = reply.status === 429 ? words.too_often : words.pair_wrong;
  } catch {
    answer.textContent = words.unreached;
  }
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  pair();
});

function fromAddress() {
  const code = location.hash.slice(1);
  if (!code) return;
  history.replaceState(null, "", "/pair");
  form.elements.code.value = code;
  pair();
}

addEventListener("hashchange", fromAddress);
fromAddress();
