// The token that turns knobs: it comes in the address, behind the #, and does not stay there.

const KEY = "mtj.token";

/** The token of this tab, if it was ever given one. */
export function token() {
  const given = /^#token=(.+)$/.exec(location.hash)?.[1];
  if (given) history.replaceState(null, "", location.pathname + location.search);
  try {
    if (given) sessionStorage.setItem(KEY, decodeURIComponent(given));
    return sessionStorage.getItem(KEY);
  } catch {
    // A browser that is told to keep nothing: the token lasts until the page is loaded again.
    return given ?? null;
  }
}

/** Forgets a token that was refused. */
export function forgetToken() {
  try {
    sessionStorage.removeItem(KEY);
  } catch {
    // There is none, then.
  }
}
