//! What a pressed pointer does to the scene on show: it clicks, turns the view, or pulls a handle.

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, InstanceId, LightId};

use crate::change::{Change, Lamp};
use crate::document::Refusal;
use crate::gizmo::{self, Drag, Gizmo, GizmoMode, Line};
use crate::input::{Button, Phase, Selection};
use crate::placed::world_from_parent;
use crate::stage::{Effect, Stage};

/// Furthest that a pointer moves in a click, as a share of the picture's height.
const CLICK: f32 = 0.01;

/// What a pressed pointer is doing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) enum Hand {
    #[default]
    Free,
    /// A click so far.
    Pressed { from: Vec2, last: Vec2, button: Button },
    /// A drag of the view.
    Turning { last: Vec2, button: Button },
    /// A handle and what it moves: an instance from its place, or a light from its position.
    Handle { drag: Drag, what: Held },
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Held {
    Instance { id: InstanceId, start: Affine3A, world_from_parent: Affine3A },
    Light { id: LightId, start: Vec3 },
}

impl Stage {
    pub(crate) fn pointer(&mut self, phase: Phase, at: Vec2, button: Button) -> Result<Effect, Refusal> {
        match (phase, self.hand) {
            (Phase::Down, _) => {
                self.hand = Hand::Pressed { from: at, last: at, button };
                if button == Button::Turn
                    && let Some((drag, what)) = self.grasp(at)
                {
                    self.gestures += 1;
                    self.hand = Hand::Handle { drag, what };
                }
                Ok(Effect::NONE)
            }
            (_, Hand::Free) => Ok(Effect::NONE),
            (Phase::Move, Hand::Pressed { from, last, button }) => {
                let far = ((at - from) * Vec2::new(self.aspect(), 1.0)).length() > CLICK;
                if !far {
                    return Ok(Effect::NONE);
                }
                self.hand = Hand::Turning { last, button };
                self.pointer(phase, at, button)
            }
            (Phase::Move, Hand::Turning { last, button }) => {
                let drag = (at - last) * Vec2::new(self.aspect(), 1.0);
                match button {
                    Button::Turn => self.navigator.turn(drag),
                    Button::Pan => self.navigator.pan(drag),
                }
                self.hand = Hand::Turning { last: at, button };
                Ok(Effect::PICTURE)
            }
            (Phase::Move, Hand::Handle { drag, what }) => self.pull(&drag, what, at),
            (Phase::Up, Hand::Pressed { button, .. }) => {
                self.hand = Hand::Free;
                let inside = at.cmpge(Vec2::ZERO).all() && at.cmple(Vec2::ONE).all();
                if button == Button::Turn && inside { self.select_at(at) } else { Ok(Effect::NONE) }
            }
            (Phase::Up, _) => {
                self.hand = Hand::Free;
                Ok(Effect::NONE)
            }
        }
    }

    /// The handle under the pointer, and what it holds.
    fn grasp(&self, at: Vec2) -> Option<(Drag, Held)> {
        let drag = self.handles()?.grasp(&self.navigator.camera(), at, self.aspect())?;
        let scene = self.document.scene();
        let what = match self.selection.as_ref()? {
            Selection::Instance { instance, holders, .. } => {
                let id = InstanceId(*instance);
                let start = scene.instances().get(&id)?.parent_from_object;
                Held::Instance { id, start, world_from_parent: world_from_parent(scene, id, holders) }
            }
            Selection::Light { light } => {
                let id = LightId(*light);
                Held::Light { id, start: Lamp::of(&scene.lights().get(&id)?.kind).position()? }
            }
        };
        Some((drag, what))
    }

    /// Moves what a handle holds.
    fn pull(&mut self, drag: &Drag, what: Held, at: Vec2) -> Result<Effect, Refusal> {
        let Some(change) = drag.world_change(&self.navigator.camera(), at, self.aspect()) else {
            return Ok(Effect::NONE);
        };
        let change = match what {
            Held::Instance { id, start, world_from_parent } => {
                let place = world_from_parent.inverse() * change * world_from_parent * start;
                Change::place(id, place)
            }
            Held::Light { id, start } => {
                let Some(light) = self.document.scene().lights().get(&id) else { return Ok(Effect::NONE) };
                let to = Lamp::of(&light.kind).at(change.transform_point3(start));
                Change::Light { light: id.0, name: light.name.clone(), to: Some(to) }
            }
        };
        self.change(change, self.gestures)
    }

    /// Where the handles of the selected thing stand.
    pub(crate) fn handles(&self) -> Option<Gizmo> {
        let scene = self.document.scene();
        match self.selection.as_ref()? {
            Selection::Instance { .. } => {
                let place = self.selected_place()?;
                let middle = self.selected_box.map_or(Vec3::ZERO, |bounds| bounds.center());
                Some(Gizmo { mode: self.gizmo, origin: place.transform_point3(middle) })
            }
            Selection::Light { light } => {
                let position = Lamp::of(&scene.lights().get(&LightId(*light))?.kind).position()?;
                // A point can be moved alone.
                Some(Gizmo { mode: GizmoMode::Move, origin: position })
            }
        }
    }

    /// The lines over the picture of a camera.
    pub(crate) fn lines(&self, camera: &Camera) -> Vec<Line> {
        const MAX_MARKS: usize = 64;
        let (scene, aspect) = (self.document.scene(), self.aspect());
        let places = scene.lights().values().filter_map(|light| Lamp::of(&light.kind).position());
        let mut lines: Vec<Line> =
            places.take(MAX_MARKS).filter_map(|place| gizmo::light_mark(camera, aspect, place)).collect();
        if let (Some(place), Some(bounds)) = (self.selected_place(), &self.selected_box) {
            lines.extend(gizmo::box_lines(camera, aspect, bounds, place));
        }
        lines.extend(self.handles().map(|handles| handles.lines(camera, aspect)).into_iter().flatten());
        lines
    }

    /// From the selected instance's object to the world.
    pub(crate) fn selected_place(&self) -> Option<Affine3A> {
        let Some(Selection::Instance { instance, holders, .. }) = &self.selection else { return None };
        let (scene, id) = (self.document.scene(), InstanceId(*instance));
        Some(world_from_parent(scene, id, holders) * scene.instances().get(&id)?.parent_from_object)
    }
}
