//! Warnings that are given once and counted always.

/// Tells the first occurrence of each problem from its repetitions, and counts all of them.
///
/// A problem is named by a key, such as an error's discriminant. A list of the keys is searched in
/// order, so keep them few; only a new key allocates.
///
/// ```
/// use mtj_protocol::warn_once::WarnOnce;
///
/// let mut warnings = WarnOnce::new();
/// let mut log = Vec::new();
/// for topic in ["torque", "state", "torque"] {
///     if warnings.first(topic) {
///         log.push(format!("ignoring a {topic} sample"));
///     }
/// }
/// assert_eq!(log, ["ignoring a torque sample", "ignoring a state sample"]);
/// assert_eq!((warnings.count(&"torque"), warnings.count(&"error")), (2, 0));
/// ```
#[derive(Clone, Debug)]
pub struct WarnOnce<K> {
    counts: Vec<(K, u64)>,
}

impl<K: PartialEq> WarnOnce<K> {
    /// No problem has occurred yet.
    pub const fn new() -> Self {
        Self { counts: Vec::new() }
    }

    /// Counts an occurrence; returns whether it is the first with this key.
    pub fn first(&mut self, key: K) -> bool {
        if let Some((_, count)) = self.counts.iter_mut().find(|(known, _)| *known == key) {
            *count += 1;
            return false;
        }
        self.counts.push((key, 1));
        true
    }

    /// How often the problem with this key has occurred.
    pub fn count(&self, key: &K) -> u64 {
        self.counts.iter().find(|(known, _)| known == key).map_or(0, |(_, count)| *count)
    }
}

impl<K: PartialEq> Default for WarnOnce<K> {
    fn default() -> Self {
        Self::new()
    }
}
