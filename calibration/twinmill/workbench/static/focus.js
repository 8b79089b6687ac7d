// SPDX-License-Identifier: Apache-2.0
// The focus of keys outlives a panel that the server draws anew: it goes on to the element of the same name.

const named = (element) => element?.closest?.("[data-testid]")?.dataset.testid;

/** From now on. */
export function keepFocus() {
  let kept; // name of what the user left last without choosing anything else
  document.addEventListener("focusin", (event) => (kept = named(event.target)));
  document.addEventListener("focusout", ({ target }) => {
    // What was removed was not left; whether it was is known once the page has been drawn.
    setTimeout(() => {
      if (target.isConnected && document.activeElement === document.body) kept = undefined;
    });
  });
  new MutationObserver(() => {
    if (kept === undefined || document.activeElement !== document.body) return;
    document.querySelector(`[data-testid="${CSS.escape(kept)}"]`)?.focus();
  }).observe(document.body, { childList: true, subtree: true, attributeFilter: ["disabled"] });
}
