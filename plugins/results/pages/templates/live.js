// A page of a run that goes on: ask every few seconds whether there is more to see.
const live = document.getElementById("live");
const watching = setInterval(async () => {
  try {
    const answer = await fetch("state");
    const state = await answer.text();
    if (answer.ok && state !== live.dataset.state) location.reload();
  } catch (error) {
    live.textContent = "The server of this page has ended; what is here stays.";
    clearInterval(watching);
  }
}, 3000);
