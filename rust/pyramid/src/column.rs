//! The levels of one column: a node of level k covers 16^k blocks.

/// Nodes of one level that a node of the next one covers.
pub const FACTOR: usize = 16;

/// Smallest and largest sample of some rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Node {
    /// Smallest sample; infinite without one.
    pub low: f64,
    /// Largest sample; minus infinity without one.
    pub high: f64,
    /// Whether a gap lies before the first sample.
    pub gap: bool,
}

impl Node {
    pub const EMPTY: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
        gap: false,
    };

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.low > self.high
    }

    /// Takes the samples that follow.
    pub fn extend(&mut self, next: Self) {
        if self.is_empty() {
            *self = next;
        } else {
            self.low = self.low.min(next.low);
            self.high = self.high.max(next.high);
        }
    }
}

/// Nodes of one level, one array a quantity: seven bytes of padding a node would be a third of the memory.
#[derive(Debug, Clone, Default)]
struct Level {
    low: Vec<f64>,
    high: Vec<f64>,
    gap: Vec<bool>,
}

impl Level {
    fn push(&mut self, node: Node) {
        self.low.push(node.low);
        self.high.push(node.high);
        self.gap.push(node.gap);
    }

    fn get(&self, k: usize) -> Node {
        Node {
            low: self.low[k],
            high: self.high[k],
            gap: self.gap[k],
        }
    }
}

/// One column, block by block.
#[derive(Debug, Clone)]
pub(crate) struct Column {
    /// Longest time between two samples without a gap, s.
    gap: f64,
    /// Level 0 holds the closed blocks.
    levels: Vec<Level>,
    open: Node,
    /// Time of the last sample; NaN before the first one.
    last: f64,
}

impl Column {
    pub fn new(gap: f64) -> Self {
        Self {
            gap,
            levels: vec![Level::default()],
            open: Node::EMPTY,
            last: f64::NAN,
        }
    }

    /// Takes rows of the open block.
    pub fn take(&mut self, t: &[f64], values: &[f64]) {
        for (&t, &value) in t.iter().zip(values) {
            if !value.is_finite() {
                continue;
            }
            let gap = t - self.last > self.gap; // false before the first sample, whose `last` is NaN
            self.open.extend(Node {
                low: value,
                high: value,
                gap,
            });
            self.last = t;
        }
    }

    /// Closes the open block, and every node above that is full with it.
    pub fn close(&mut self) {
        let mut node = std::mem::replace(&mut self.open, Node::EMPTY);
        let mut level = 0;
        loop {
            if level == self.levels.len() {
                self.levels.push(Level::default());
            }
            self.levels[level].push(node);
            let n = self.levels[level].low.len();
            if !n.is_multiple_of(FACTOR) {
                return;
            }
            node = Node::EMPTY;
            for k in n - FACTOR..n {
                node.extend(self.levels[level].get(k));
            }
            level += 1;
        }
    }

    /// Samples of the blocks `from <= block < to`, from the fewest nodes; the block after the closed ones is the open one.
    pub fn range(&self, from: usize, to: usize) -> Node {
        let closed = self.levels[0].low.len();
        let mut node = Node::EMPTY;
        let mut at = from;
        while at < to.min(closed) {
            let (mut level, mut size) = (0, 1);
            while level + 1 < self.levels.len()
                && at.is_multiple_of(size * FACTOR)
                && at + size * FACTOR <= to.min(closed)
            {
                level += 1;
                size *= FACTOR;
            }
            node.extend(self.levels[level].get(at / size));
            at += size;
        }
        if to > closed {
            node.extend(self.open);
        }
        node
    }

    /// Bytes that the nodes take.
    pub fn bytes(&self) -> usize {
        self.levels
            .iter()
            .map(|level| 2 * size_of::<f64>() * level.low.capacity() + level.gap.capacity())
            .sum()
    }
}
