//! relight-play
