// Light or dark as chosen on this computer before, else as the system. In the head, so that nothing flashes.
try {
  const chosen = localStorage.getItem("truespring-theme");
  if (chosen) document.documentElement.dataset.theme = chosen;
} catch { /* without storage, as the system */ }
