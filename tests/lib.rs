//! Helpers that several system tests share.
