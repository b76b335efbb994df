// The token that requests need: it comes in the address, after the #, and is removed from there.

const KEY = "mtj.token";

/** The token of this tab, if it was ever given one. */
export function token() {
  const given = /^#token=(.+)$/.exec(location.hash)?.[1];
  if (given) history.replaceState(null, "", location.pathname + location.search);
  try {
    if (given) sessionStorage.setItem(KEY, decodeURIComponent(given));
    return sessionStorage.getItem(KEY);
  } catch {
    // A browser that may not store anything: the token lasts until the page is loaded again.
    return given ?? null;
  }
}

/** Forgets a token that was refused. */
export function forgetToken() {
  try {
    sessionStorage.removeItem(KEY);
  } catch {
    // A browser that may not store anything has stored no token.
  }
}
