"use strict";
// Shared by the pages: requests with the session's token, and the line that reports errors.
const token = new URLSearchParams(location.search).get("token") || "";
const $ = id => document.getElementById(id);
const headers = {"x-pliant-token": token};

async function ask(name, body) {
  const answer = await fetch(`/api/${name}`, body === undefined ? {headers} :
    {method: "POST", headers: {...headers, "content-type": "application/json"}, body: JSON.stringify(body)});
  if (answer.status === 403) throw new Error(await answer.text());
  const found = await answer.json();
  if (!answer.ok) throw new Error(found.error || "it failed");
  return found;
}
function say(text) { $("said").textContent = text; $("said").hidden = !text; }
