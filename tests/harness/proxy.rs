//! A link between a worker and its coordinator that can be cut and frozen.

use std::io::{Read as _, Write as _};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

/// Forwards every connection to one address, until told otherwise.
///
/// Its threads end when it is dropped, by the end of their connections.
pub(crate) struct Proxy {
    address: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    frozen: bool,
    closed: bool,
    accepted: usize,
    open: Vec<TcpStream>,
}

impl Proxy {
    /// A proxy on a free port of loopback.
    pub(crate) fn to(target: SocketAddr) -> Self {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let address = listener.local_addr().unwrap();
        let shared = Arc::new(Shared {
            state: Mutex::default(),
            changed: Condvar::new(),
        });
        let accepting = Arc::clone(&shared);
        thread::spawn(move || accept(&listener, target, &accepting));
        Self { address, shared }
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// How many connections were opened through it so far.
    pub(crate) fn accepted(&self) -> usize {
        self.shared.lock().accepted
    }

    /// Cuts every connection; new ones are let through.
    pub(crate) fn cut(&self) {
        for end in self.shared.lock().open.drain(..) {
            // One that has ended already is as cut as it can be.
            let _ = end.shutdown(Shutdown::Both);
        }
    }

    /// From now on nothing passes, though connections stay open and can be opened.
    pub(crate) fn freeze(&self) {
        self.shared.lock().frozen = true;
    }

    /// Lets pass again, what was held back included.
    pub(crate) fn thaw(&self) {
        self.shared.lock().frozen = false;
        self.shared.changed.notify_all();
    }
}

impl Drop for Proxy {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.thaw();
        self.cut();
        // Wakes the accepting thread, which then sees that it is closed.
        let _ = TcpStream::connect(self.address);
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait_while_frozen(&self) {
        let state = self.lock();
        drop(self.changed.wait_while(state, |state| state.frozen));
    }
}

fn accept(listener: &TcpListener, target: SocketAddr, shared: &Arc<Shared>) {
    for near in listener.incoming() {
        if shared.lock().closed {
            return;
        }
        // A coordinator that is not there is, to the worker, a link that closes at once.
        let (Ok(near), Ok(far)) = (near, TcpStream::connect(target)) else {
            continue;
        };
        let clones = |end: &TcpStream| (end.try_clone().unwrap(), end.try_clone().unwrap());
        let ((near_in, near_out), (far_in, far_out)) = (clones(&near), clones(&far));
        let mut state = shared.lock();
        state.accepted += 1;
        state.open.extend([near, far]);
        drop(state);
        for (from, into) in [(near_in, far_out), (far_in, near_out)] {
            let shared = Arc::clone(shared);
            thread::spawn(move || forward(from, into, &shared));
        }
    }
}

fn forward(mut from: TcpStream, mut into: TcpStream, shared: &Shared) {
    let mut bytes = vec![0; 64 << 10];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        shared.wait_while_frozen();
        if into.write_all(&bytes[..count]).is_err() {
            break;
        }
    }
    let _ = from.shutdown(Shutdown::Both);
    let _ = into.shutdown(Shutdown::Both);
}
