// SPDX-License-Identifier: Apache-2.0
// The focus of keys outlives a panel that the server draws anew, and a button that is hidden while it works:
// it goes on to the element of the same name, once that can be reached.

const named = (element) => element?.closest?.("[data-testid]")?.dataset.testid;

/** From now on. */
export function keepFocus() {
  let kept; // name of what the user left last without choosing anything else
  document.addEventListener("focusin", (event) => (kept = named(event.target)));
  document.addEventListener("focusout", ({ target }) => {
    // What was removed or hidden was not left; whether it was is known once the page has been drawn.
    setTimeout(() => {
      if (target.checkVisibility() && document.activeElement === document.body) kept = undefined;
    });
  });
  new MutationObserver(() => {
    if (kept === undefined || document.activeElement !== document.body) return;
    document.querySelector(`[data-testid="${CSS.escape(kept)}"]`)?.focus();
  }).observe(document.body, { childList: true, subtree: true, attributeFilter: ["class", "disabled"] });
}
