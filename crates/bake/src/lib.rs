//! relight-bake
