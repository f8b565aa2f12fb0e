//! A part of a file as a file of its own.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// Bytes `first..first + length` of a file.
pub(super) struct PartOfFile {
    file: File,
    first: u64,
    length: u64,
    /// Where the next byte is read, from the first of the part.
    at: u64,
}

impl PartOfFile {
    pub fn new(mut file: File, first: u64, length: u64) -> io::Result<Self> {
        file.seek(SeekFrom::Start(first))?;
        Ok(Self { file, first, length, at: 0 })
    }
}

impl Read for PartOfFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = usize::try_from(self.length.saturating_sub(self.at)).unwrap_or(usize::MAX);
        let most = buffer.len().min(left);
        let read = self.file.read(&mut buffer[..most])?;
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for PartOfFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = match to {
            SeekFrom::Start(place) => Some(place),
            SeekFrom::End(by) => self.length.checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        let place = place.ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
        self.file.seek(SeekFrom::Start(self.first.saturating_add(place)))?;
        self.at = place;
        Ok(place)
    }
}
