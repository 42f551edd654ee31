//! Git LFS keeps big files elsewhere and leaves a short text in their place until somebody fetches them.

/// Whether these are the bytes of such a text (Git LFS, pointer specification version 1) instead of a file's own.
pub(crate) fn is_lfs_pointer(bytes: &[u8]) -> bool {
    bytes.starts_with(b"version https://git-lfs")
}

/// What such a file is and what to do, after its name.
pub(crate) const LFS_ADVICE: &str =
    "is a Git LFS pointer, not the file itself: run `git lfs pull` in its repository to fetch it";
