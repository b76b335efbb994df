//! States that never came.

use mtj_protocol::port::Message;

/// Counts the states that are missing between those that come.
#[derive(Debug, Default)]
pub(super) struct Gaps {
    /// Run and sequence number of the newest state.
    newest: Option<(u64, u64)>,
    missed: u64,
}

impl Gaps {
    /// Notes a message.
    pub(super) fn note(&mut self, message: &Message) {
        let Message::State(state) = message else { return };
        let header = state.header;
        if let Some((run, sequence)) = self.newest
            && run == header.run
        {
            self.missed += header.sequence.saturating_sub(sequence + 1);
        }
        self.newest = Some((header.run, header.sequence));
    }

    /// How many states are missing.
    pub(super) fn missed(&self) -> u64 {
        self.missed
    }
}
