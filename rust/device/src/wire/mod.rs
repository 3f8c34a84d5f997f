//! The binary form of the wire protocol, `docs/wire.md`: frames that no loss of bytes can shift.
//!
//! A frame is a body and its CRC-16, framed by consistent overhead byte stuffing (Cheshire and Baker 1999) so that the byte 0 ends
//! it and stands nowhere else. Whatever came before a 0, what comes after it is read afresh.

pub mod announcement;
pub mod decoder;
pub mod encoder;
pub mod frame;
