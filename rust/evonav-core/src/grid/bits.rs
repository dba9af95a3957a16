//! Grids with one bit per cell and 64 cells per word: a 400 x 400 map takes 22 kB and stays in
//! cache.

/// A grid of bits, `[row, col]`. Bits outside the grid read as 0.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BitGrid {
    rows: usize,
    cols: usize,
    /// Words per row; the bits beyond `cols` stay 0.
    stride: usize,
    words: Vec<u64>,
}

impl BitGrid {
    /// Create a grid whose bits are all 0.
    pub fn new(rows: usize, cols: usize) -> Self {
        let stride = cols.div_ceil(64);
        Self { rows, cols, stride, words: vec![0; rows * stride] }
    }

    /// Return the number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Return the number of columns.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Return the bit of a cell; 0 outside.
    pub fn get(&self, row: usize, col: usize) -> bool {
        row < self.rows
            && col < self.cols
            && self.words[row * self.stride + col / 64] >> (col % 64) & 1 != 0
    }

    /// Set the bit of a cell to 1; cells outside the grid are ignored.
    pub fn insert(&mut self, row: usize, col: usize) {
        if row < self.rows && col < self.cols {
            self.words[row * self.stride + col / 64] |= 1 << (col % 64);
        }
    }

    /// Set the bit of a cell to 0.
    pub fn remove(&mut self, row: usize, col: usize) {
        if row < self.rows && col < self.cols {
            self.words[row * self.stride + col / 64] &= !(1 << (col % 64));
        }
    }

    /// Set the bits `start..end` of a row to 1.
    pub fn insert_run(&mut self, row: usize, start: usize, end: usize) {
        let end = end.min(self.cols);
        if row >= self.rows || start >= end {
            return;
        }
        let row_words = &mut self.words[row * self.stride..][..self.stride];
        let (first, last) = (start / 64, (end - 1) / 64);
        if first == last {
            row_words[first] |= (u64::MAX >> (64 - (end - start))) << (start % 64);
            return;
        }
        row_words[first] |= u64::MAX << (start % 64);
        row_words[first + 1..last].fill(u64::MAX);
        row_words[last] |= u64::MAX >> (63 - (end - 1) % 64);
    }

    /// Set all bits to 0.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Set the bits that are 1 in `other`, a grid of the same shape.
    pub fn unite(&mut self, other: &Self) {
        self.words.iter_mut().zip(&other.words).for_each(|(word, other)| *word |= other);
    }

    /// Clear the bits that are 0 in `other`, a grid of the same shape.
    pub fn intersect(&mut self, other: &Self) {
        self.words.iter_mut().zip(&other.words).for_each(|(word, other)| *word &= other);
    }

    /// Clear the bits that are 1 in `other`, a grid of the same shape.
    pub fn subtract(&mut self, other: &Self) {
        self.words.iter_mut().zip(&other.words).for_each(|(word, other)| *word &= !other);
    }

    /// Invert every bit.
    pub fn invert(&mut self) {
        for row in 0..self.rows {
            for word in 0..self.stride {
                let mask = self.word_mask(word);
                let bits = &mut self.words[row * self.stride + word];
                *bits = !*bits & mask;
            }
        }
    }

    /// Return the number of bits that are 1.
    pub fn count(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Return whether no bit is 1.
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// Return the words of a row: column `col` is bit `col % 64` of word `col / 64`. Empty for a
    /// row outside the grid.
    pub fn row(&self, row: usize) -> &[u64] {
        if row < self.rows { &self.words[row * self.stride..][..self.stride] } else { &[] }
    }

    /// Return the words of a row for writing; bits beyond the last column must stay 0.
    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [u64] {
        &mut self.words[row * self.stride..][..self.stride]
    }

    /// Return the bits of a word that lie on the grid.
    pub(crate) fn word_mask(&self, word: usize) -> u64 {
        let cols = self.cols - (word * 64).min(self.cols);
        if cols >= 64 { u64::MAX } else { (1 << cols) - 1 }
    }

    /// Return `[row, col]` of the bits that are 1, row-major.
    pub fn cells(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        (0..self.rows).flat_map(move |row| {
            self.row(row)
                .iter()
                .enumerate()
                .flat_map(move |(index, &word)| ones(word).map(move |bit| [row, index * 64 + bit]))
        })
    }

    /// Return every bit, row-major.
    pub fn to_bools(&self) -> Vec<bool> {
        let mut bits = vec![false; self.rows * self.cols];
        self.cells().for_each(|[row, col]| bits[row * self.cols + col] = true);
        bits
    }

    /// Return 64 bits of a row, starting at column `first`, which may be negative; bits outside are
    /// 0.
    pub(crate) fn window(&self, row: usize, first: i64) -> u64 {
        let row_words = self.row(row);
        let at = |word: i64| row_words.get(word as usize).copied().unwrap_or(0);
        // A word before the first becomes one far behind the last.
        let (word, shift) = (first >> 6, first & 63);
        let next = if shift == 0 { 0 } else { at(word + 1) << (64 - shift) };
        at(word) >> shift | next
    }
}

/// Return the sum and carry of three bits, 64 at once.
pub(crate) fn add3([a, b, c]: [u64; 3]) -> (u64, u64) {
    (a ^ b ^ c, (a & b) | (c & (a ^ b)))
}

/// Return the cells above, left, right and below; some may be off the grid.
pub(crate) fn beside([row, col]: [usize; 2]) -> [[usize; 2]; 4] {
    [[row.wrapping_sub(1), col], [row, col.wrapping_sub(1)], [row, col + 1], [row + 1, col]]
}

/// Return the positions of the 1 bits of a word, ascending.
pub(crate) fn ones(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
        word &= word - 1;
        Some(bit)
    })
}
