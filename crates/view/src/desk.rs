//! Between tabs and the thread that paints: per tab the newest wish and the newest answers. Nothing queues up.

use crate::exhibit::Maps;
use crate::wish::{Pick, Show, Wish};
use relight_play::scene::light::EnvironmentMap;
use std::collections::{BTreeMap, VecDeque};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Notify, oneshot};

/// Most tabs at a time.
pub const MOST_TABS: usize = 8;
/// Most pictures to save that wait.
const MOST_SAVES: usize = 4;
/// Most environment maps.
const MOST_MAPS: usize = 16;
/// Most words that wait for a tab; older ones are dropped.
const MOST_WORDS: usize = 16;

/// How good a picture is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Fewer pixels, one sample.
    Coarse,
    /// All pixels, one sample; of large pictures fewer.
    Middle,
    /// What `relight play` writes.
    Final,
    /// Path tracing beside it, one pass better than before.
    Beside,
}

impl Stage {
    /// Its name in the protocol.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Coarse => "coarse",
            Stage::Middle => "middle",
            Stage::Final => "final",
            Stage::Beside => "beside",
        }
    }

    /// What follows it for a wish; of path tracing beside, whatever was made so far.
    pub fn next(self, wish: &Wish) -> Option<Stage> {
        match self {
            _ if wish.moving => None,
            Stage::Coarse => Some(Stage::Middle),
            Stage::Middle => Some(Stage::Final),
            Stage::Final | Stage::Beside => wish.compares().then_some(Stage::Beside),
        }
    }
}

/// What waits to be sent to a tab.
#[derive(Default)]
pub struct Outbox {
    waiting: Mutex<Waiting>,
    /// Rings when something is there.
    pub bell: Notify,
}

#[derive(Default)]
struct Waiting {
    words: VecDeque<String>,
    picture: Option<Vec<u8>>,
}

impl Outbox {
    /// Puts words in, as JSON.
    pub fn say(&self, words: String) {
        let mut waiting = lock(&self.waiting);
        if waiting.words.len() == MOST_WORDS {
            waiting.words.pop_front();
        }
        waiting.words.push_back(words);
        self.bell.notify_one();
    }

    /// Puts a picture in, in place of one that was not sent yet.
    pub fn show(&self, picture: Vec<u8>) {
        lock(&self.waiting).picture = Some(picture);
        self.bell.notify_one();
    }

    /// Takes the oldest words.
    pub fn words(&self) -> Option<String> {
        lock(&self.waiting).words.pop_front()
    }

    /// Takes the picture.
    pub fn picture(&self) -> Option<Vec<u8>> {
        lock(&self.waiting).picture.take()
    }
}

struct Tab {
    outbox: Arc<Outbox>,
    wish: Option<Arc<Wish>>,
    /// The next picture to make of it.
    stage: Option<Stage>,
    pick: Option<Pick>,
}

/// A picture to be saved: a wish, and where its file goes.
pub struct Save {
    /// What to make.
    pub wish: Wish,
    /// Whether as 32-bit floats.
    pub float: bool,
    /// Gets the OpenEXR file, or why there is none.
    pub answer: oneshot::Sender<Result<Vec<u8>, String>>,
}

/// What is to be done next.
pub enum Task {
    /// A picture for a tab.
    Paint {
        /// Whose.
        tab: u64,
        /// What.
        wish: Arc<Wish>,
        /// How good.
        stage: Stage,
        /// Where it goes.
        outbox: Arc<Outbox>,
    },
    /// What a pixel of a tab shows.
    Pick {
        /// Whose.
        tab: u64,
        /// What the tab sees.
        wish: Arc<Wish>,
        /// Which pixel.
        pick: Pick,
        /// Where it goes.
        outbox: Arc<Outbox>,
    },
    /// A picture to be saved.
    Save(Save),
    /// The asset's file is another one now.
    Reopen,
    /// Nobody wants anything more.
    End,
}

#[derive(Default)]
struct State {
    tabs: BTreeMap<u64, Tab>,
    last_tab: u64,
    /// Who was served last: the others come first.
    served: u64,
    saves: VecDeque<Save>,
    closed: bool,
    maps: Maps,
    reopen: bool,
    /// What each tab is told first.
    hello: String,
}

/// The desk.
#[derive(Default)]
pub struct Desk {
    state: Mutex<State>,
    work: Condvar,
    /// Something came that refinements must not hold up.
    urgent: AtomicBool,
    closed: AtomicBool,
}

/// A panic elsewhere leaves nothing half done here: every change is one assignment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Desk {
    /// A desk that knows some environment maps, and what each tab is told first.
    pub fn new(maps: Maps, hello: String) -> Desk {
        let desk = Desk::default();
        {
            let mut state = lock(&desk.state);
            (state.maps, state.hello) = (maps, hello);
        }
        desk
    }

    /// What a new tab is told first.
    pub fn hello(&self) -> String {
        lock(&self.state).hello.clone()
    }

    /// The asset's file is another one now.
    pub fn reopen(&self) {
        lock(&self.state).reopen = true;
        self.ring();
    }

    /// Another asset is shown: all tabs are told as if they had come just now. Maps that were dropped stay.
    pub fn reopened(&self, maps: Maps, hello: String) {
        let mut state = lock(&self.state);
        state.maps.extend(maps);
        for tab in state.tabs.values_mut() {
            (tab.wish, tab.stage, tab.pick) = (None, None, None);
            tab.outbox.say(hello.clone());
        }
        state.hello = hello;
    }

    /// A new tab; `None` where there are too many.
    pub fn enter(&self) -> Option<(u64, Arc<Outbox>)> {
        let mut state = lock(&self.state);
        if state.tabs.len() >= MOST_TABS || state.closed {
            return None;
        }
        state.last_tab += 1;
        let id = state.last_tab;
        let outbox = Arc::new(Outbox::default());
        let tab = Tab {
            outbox: outbox.clone(),
            wish: None,
            stage: None,
            pick: None,
        };
        state.tabs.insert(id, tab);
        Some((id, outbox))
    }

    /// A tab is gone.
    pub fn leave(&self, tab: u64) {
        lock(&self.state).tabs.remove(&tab);
        self.ring();
    }

    fn ring(&self) {
        self.urgent.store(true, Ordering::Relaxed);
        self.work.notify_all();
    }

    /// A tab wants another picture: the newest wish takes the place of the last.
    ///
    /// # Errors
    /// It cannot be made, in words.
    pub fn show(&self, tab: u64, show: Show) -> Result<(), String> {
        let mut state = lock(&self.state);
        let Some(tab) = state.tabs.get_mut(&tab) else {
            return Ok(());
        };
        let wish = show.wish(tab.wish.as_deref())?;
        // What has stopped moving is refined where it was coarse already.
        let refine = !wish.moving
            && tab.stage.is_none()
            && (tab.wish.as_ref()).is_some_and(|before| before.moving && before.is_like(&wish));
        tab.stage = Some(if refine { Stage::Middle } else { Stage::Coarse });
        tab.wish = Some(Arc::new(wish));
        drop(state);
        self.ring();
        Ok(())
    }

    /// A tab wants to know what a pixel shows.
    pub fn pick(&self, tab: u64, pick: Pick) {
        if let Some(tab) = lock(&self.state).tabs.get_mut(&tab) {
            tab.pick = Some(pick);
        }
        self.ring();
    }

    /// A picture shall be saved.
    ///
    /// # Errors
    /// Too many wait already.
    pub fn save(&self, save: Save) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.saves.len() >= MOST_SAVES || state.closed {
            return Err("other pictures are being saved: try again in a while".into());
        }
        state.saves.push_back(save);
        drop(state);
        self.work.notify_all();
        Ok(())
    }

    /// Environment maps that lights may name.
    pub fn maps(&self) -> Maps {
        lock(&self.state).maps.clone()
    }

    /// Lights may name another map.
    ///
    /// # Errors
    /// There are so many already.
    pub fn add_map(&self, name: PathBuf, map: Arc<EnvironmentMap>) -> Result<(), String> {
        let mut state = lock(&self.state);
        if state.maps.len() >= MOST_MAPS && !state.maps.contains_key(&name) {
            return Err(format!(
                "{MOST_MAPS} maps were dropped already: start relight view anew"
            ));
        }
        state.maps.insert(name, map.into());
        Ok(())
    }

    /// Everything ends.
    pub fn close(&self) {
        self.closed.store(true, Ordering::Relaxed);
        let mut state = lock(&self.state);
        state.closed = true;
        // Who waits for a picture to save hears that there will be none.
        state.saves.clear();
        state.tabs.values().for_each(|tab| tab.outbox.bell.notify_one());
        drop(state);
        self.ring();
    }

    /// Whether everything ends.
    pub fn closed(&self) -> bool {
        self.closed.load(Ordering::Relaxed)
    }

    /// Whether a refinement shall give way.
    pub fn urgent(&self) -> bool {
        self.urgent.load(Ordering::Relaxed)
    }

    /// Which tabs there are.
    pub fn tabs(&self) -> Vec<u64> {
        lock(&self.state).tabs.keys().copied().collect()
    }

    /// Waits for something to do: what moves first, tab by tab in turn, then what was picked, then what refines, then what is
    /// saved, then path tracing.
    pub fn next(&self) -> Task {
        let mut state = lock(&self.state);
        loop {
            self.urgent.store(false, Ordering::Relaxed);
            if state.closed {
                return Task::End;
            }
            if std::mem::take(&mut state.reopen) {
                return Task::Reopen;
            }
            if let Some(task) = state.coarse().or_else(|| state.picked()) {
                return task;
            }
            if let Some(task) = state.paint(|stage| stage != Stage::Beside) {
                return task;
            }
            if let Some(save) = state.saves.pop_front() {
                return Task::Save(save);
            }
            // Path tracing goes on for long: it holds up nothing.
            if let Some(task) = state.paint(|_| true) {
                return task;
            }
            state = self.work.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Nothing that is wanted now can be made.
    pub fn give_up(&self, why: &str) {
        for tab in lock(&self.state).tabs.values_mut() {
            tab.stage = None;
        }
        self.say_refused(why);
    }

    /// Tells all tabs what can't be done.
    pub fn say_refused(&self, what: &str) {
        for tab in lock(&self.state).tabs.values() {
            tab.outbox
                .say(serde_json::json!({ "refused": { "id": null, "what": what } }).to_string());
        }
    }

    /// A tab's picture was made, or can't be: if it wants nothing else by now, `next` is.
    pub fn painted(&self, tab: u64, wish: &Arc<Wish>, next: Option<Stage>) {
        if let Some(tab) = lock(&self.state).tabs.get_mut(&tab)
            && tab.wish.as_ref().is_some_and(|newest| Arc::ptr_eq(newest, wish))
        {
            tab.stage = next;
        }
    }
}

impl State {
    fn coarse(&mut self) -> Option<Task> {
        self.paint(|stage| stage == Stage::Coarse)
    }

    fn picked(&mut self) -> Option<Task> {
        self.tabs.iter_mut().find_map(|(id, tab)| {
            Some(Task::Pick {
                tab: *id,
                wish: tab.wish.clone()?,
                pick: tab.pick.take()?,
                outbox: tab.outbox.clone(),
            })
        })
    }

    /// The next tab in turn with a picture to make at such a stage.
    fn paint(&mut self, wanted: impl Fn(Stage) -> bool) -> Option<Task> {
        let served = self.served;
        let found = (self.tabs.iter())
            .filter_map(|(id, tab)| Some((*id, tab, tab.wish.as_ref()?, tab.stage.filter(|s| wanted(*s))?)))
            .min_by_key(|(id, ..)| (*id <= served, *id));
        let (id, tab, wish, stage) = found?;
        let task = Task::Paint {
            tab: id,
            wish: wish.clone(),
            stage,
            outbox: tab.outbox.clone(),
        };
        self.served = id;
        Some(task)
    }
}
