//! `isp`: image signal processors, ours and those of others.

pub mod external;
