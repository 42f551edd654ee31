//! Which state of its materials a player has.

/// Which materials a player has: how often they were replaced, and how often they moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Edition {
    pub edits: u64,
    pub moves: u64,
}
