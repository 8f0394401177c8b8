//! Ctrl-C and its kin: the first asks for an orderly end, the second ends at once.

use tokio::sync::watch;

/// Exit status after an interrupt: 128 + SIGINT, as shells have it.
pub(crate) const INTERRUPTED: u8 = 130;

/// Tells, from now on, whether an end was asked for.
#[derive(Clone, Debug)]
pub(crate) struct Interrupt(watch::Receiver<bool>);

impl Interrupt {
    /// Listens for Ctrl-C and a request to terminate. A second one ends the process at once.
    pub(crate) fn listen() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        let mut interrupts = signal(SignalKind::interrupt())?;
        let mut terminations = signal(SignalKind::terminate())?;
        let (sender, receiver) = watch::channel(false);
        tokio::spawn(async move {
            for is_last in [false, true] {
                tokio::select! {
                    _ = interrupts.recv() => {}
                    _ = terminations.recv() => {}
                }
                if is_last {
                    leave_at_once();
                }
                sender.send_replace(true);
            }
        });
        Ok(Self(receiver))
    }

    /// Whether an end has been asked for.
    pub(crate) fn is_asked(&self) -> bool {
        *self.0.borrow()
    }

    /// Waits until an end is asked for.
    pub(crate) async fn asked(&mut self) {
        if self.0.wait_for(|&asked| asked).await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

#[expect(
    clippy::disallowed_methods,
    reason = "whoever asks twice does not want destructors to run"
)]
fn leave_at_once() -> ! {
    std::process::exit(i32::from(INTERRUPTED))
}
