//! relight-transport
