"""Changes to viser's page: the scenario's name in the tab, the system's dark mode, a scene on a phone.

The page of viser chooses its colours by ``__VISER_EMBED_CONFIG__`` once, when it starts. On a narrow screen
its panel covers up to 60 % of the scene: here the scene ends where the panel begins.
"""

from __future__ import annotations

from html import escape

TITLE_PATH = "/title"
"""Path at which the page asks for its title until the first scene is there."""
_NAME = "outrider"
_STYLE = """
@media (max-width: 36em) {
  #root > div:first-of-type { height: 60% !important; }
  #root [style*="max-height: 60%"] { max-height: 40% !important; width: 100% !important; }
  #root [style*="max-height: 60%"] [style*="width: 20em"] { width: 100% !important; }
}
"""
_DARK = """
const system = matchMedia("(prefers-color-scheme: dark)");
window.__VISER_EMBED_CONFIG__ = { darkMode: system.matches };
system.addEventListener("change", () => location.reload());
"""
_TITLE = """
const ask = async () => {
  const answer = await fetch("title").catch(() => null);
  const text = answer && answer.ok ? await answer.text() : "";
  if (text) document.title = text;
  else setTimeout(ask, 1000);
};
ask();
"""


def title_of(name: str) -> str:
    """Return the title of the tab for a scene's ``name``; an empty name is none."""
    return f"{name} · {_NAME}" if name else ""


def live_page(page: str, name: str) -> str:
    """Return the ``page`` of viser for a browser that connects, with the ``name`` of the scene, or empty."""
    return _changed(page, name, _DARK + ("" if name else _TITLE))


def recorded_page(page: str, name: str) -> str:
    """Return a ``page`` of viser that holds a recording, with the ``name`` of its scene."""
    return _changed(page, name, _DARK)


def _changed(page: str, name: str, script: str) -> str:
    title = escape(title_of(name) or _NAME)
    page = page.replace("<title>Viser</title>", f"<title>{title}</title>", 1)
    head, end, rest = page.partition("</head>")
    return f"{head}<style>{_STYLE}</style><script>{{{script}}}</script>{end}{rest}"
