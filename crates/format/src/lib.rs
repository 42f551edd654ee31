//! relight-format
