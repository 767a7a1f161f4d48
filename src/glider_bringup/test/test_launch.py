# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file: what it starts, with which parameters, and what it refuses."""

import importlib.util
import sys
from pathlib import Path

import pytest
import yaml

from glider_base.settings import ConfigurationError
from glider_bringup.engines import launch_plan
from glider_bringup.engines.launch_plan import (
    ARGUMENTS,
    TF,
    LaunchedNode,
    check_names,
    plan_launch,
)
from glider_bringup.engines.processes import MODULES, ON_BOARD, PLANT, RECORDER
from glider_control.settings import ControlLawSettings
from glider_guidance.settings import LosSettings
from glider_mission.scenario import scenario_names

LAUNCH_FILE = Path(__file__).parents[1] / 'launch' / 'glider.launch.py'


def parameters(plan) -> dict[str, dict]:
    """Contents of the parameter file, by full name of the node."""
    values = yaml.safe_load(plan.parameters_file.read_text())
    return {name: entry['ros__parameters'] for name, entry in values.items()}


@pytest.fixture(autouse=True)
def tf2(monkeypatch):
    """tf2_msgs is not there, wherever this runs; tests say where it is."""
    there = []
    monkeypatch.setattr(launch_plan, 'find_spec', lambda name: there or None)
    return there


# ---------------------------------------------------------------------- without the launch system


def test_defaults_fly_the_default_scenario_in_lockstep_and_real_time(tmp_path):
    plan = plan_launch({}, tmp_path)
    assert plan.parameters_file.parent == tmp_path / 'glider'
    assert plan.namespace == '/glider'
    assert plan.lockstep
    assert {node.executable for node in plan.nodes} == set(MODULES) - {RECORDER}
    values = parameters(plan)
    # the file tells a recorder, too, that is started by hand
    executables = {RECORDER} | {node.executable for node in plan.nodes}
    assert set(values) == {f'/glider/{name}' for name in executables}
    assert all(entry['lockstep'] and not entry['record'] for entry in values.values())
    assert values['/glider/plant_node']['speed'] == 1.0
    assert values['/glider/plant_node']['dives'] == plan.scenario.dives == 1


def test_gliders_of_one_launch_have_each_their_parameters(tmp_path):
    one = plan_launch({'namespace': 'sea/one', 'controller': 'pid'}, tmp_path)
    plan_launch({'namespace': 'sea/two'}, tmp_path)
    assert parameters(one)['/sea/one/control_node']['law'] == 'pid'


def test_arguments_reach_the_parameters(tmp_path):
    arguments = {
        'scenario': 'helix',
        'controller': 'pid',
        'guidance': 'paper',
        'namespace': '/sea/one/',
        'speed': 'max',
        'duration': '120',
    }
    values = parameters(plan_launch(arguments, tmp_path))
    plant = values['/sea/one/plant_node']
    assert (plant['speed'], plant['duration_s'], plant['dives']) == (0.0, 120.0, 0)
    assert values['/sea/one/control_node']['law'] == 'pid'
    assert values['/sea/one/guidance_node']['los']['method'] == 'los_zhang2021'
    assert '"kind":"helix"' in values['/sea/one/guidance_node']['path']


def test_full_duration_is_the_scenarios(tmp_path):
    plan = plan_launch({'duration': 'full'}, tmp_path)
    assert plan.scenario.dives == 0
    plant = parameters(plan)['/glider/plant_node']
    assert plant['duration_s'] == plan.scenario.duration_s == 108000.0


def test_free_running(tmp_path):
    plan = plan_launch({'lockstep': 'false'}, tmp_path)
    assert not plan.lockstep
    assert not any(entry['lockstep'] for entry in parameters(plan).values())


@pytest.mark.parametrize(
    ('arguments', 'names'),
    [
        ({'lockstep': 'false'}, {wired.node for wired in ON_BOARD}),
        ({'lockstep': 'false', 'autopilot': 'true'}, set()),
        ({}, set()),
    ],
)
def test_nodes_on_board_that_run_freely_are_managed(tmp_path, arguments, names):
    plan = plan_launch(arguments, tmp_path)
    told = {name for name, entry in parameters(plan).items() if entry.get('managed')}
    assert set(plan.managed) == names
    assert told == {f'/glider/{name}' for name in names}


def test_autopilot_takes_the_place_of_its_nodes(tmp_path):
    plan = plan_launch({'autopilot': 'true'}, tmp_path)
    assert plan.nodes == (
        LaunchedNode('glider_bringup', 'autopilot'),
        LaunchedNode('glider_model', 'current_node'),
        LaunchedNode('glider_model', 'plant_node'),
    )
    aboard = {f'/glider/{wired.node}' for wired in ON_BOARD}
    assert len(aboard) == 4 and aboard < set(parameters(plan))


def test_vehicle_of_ones_own_has_guidance_control_and_guard_alone(tmp_path):
    arguments = {'simulate': 'false', 'lockstep': 'false', 'record': str(tmp_path / 'flight')}
    plan = plan_launch(arguments, tmp_path)
    names = {node.executable for node in plan.nodes}
    assert names == {'guidance_node', 'control_node', 'guard_node', RECORDER}
    assert not any(entry['lockstep'] for entry in parameters(plan).values())


@pytest.mark.parametrize(
    ('navigation', 'method', 'nodes'),
    [
        ('auto', 'known', []),
        ('auto', 'dead_reckoned', ['navigation_node']),
        ('true', 'known', ['navigation_node']),
        ('false', 'dead_reckoned', []),
    ],
)
def test_navigation_of_a_vehicle_can_be_left_out(tmp_path, navigation, method, nodes):
    scenario = tmp_path / 'mine.yaml'
    scenario.write_text(f'navigation: {{method: {method}}}\nprofile: {{clearance_m: 15}}\n')
    arguments = {
        **{'simulate': 'false', 'lockstep': 'false'},
        **{'scenario': str(scenario), 'navigation': navigation},
    }
    plan = plan_launch(arguments, tmp_path)
    aboard = [*nodes, 'guidance_node', 'control_node', 'guard_node']
    assert [node.executable for node in plan.nodes] == aboard
    has_pressure = bool(nodes) and method == 'dead_reckoned'
    assert parameters(plan)['/glider/guard_node']['pressure'] == has_pressure
    for node in 'guidance_node', 'guard_node':
        assert parameters(plan)[f'/glider/{node}']['altitude'], 'it keeps clear of the bottom'
    arguments['scenario'] = str(tmp_path / 'fitted.yaml')
    fitted = scenario.read_text() + 'sensors: {also_fitted: [pressure]}\n'
    Path(arguments['scenario']).write_text(fitted)
    assert parameters(plan_launch(arguments, tmp_path))['/glider/guard_node']['pressure']
    (autopilot,) = plan_launch({**arguments, 'autopilot': 'true'}, tmp_path).nodes
    assert autopilot.executable == 'autopilot'
    assert autopilot.words == (() if nodes else ('guidance', 'control', 'guard'))


def test_vehicle_that_does_not_know_its_place_has_navigation_too(tmp_path):
    scenario = tmp_path / 'reckoned.yaml'
    scenario.write_text('navigation: {method: dead_reckoned}\n')
    arguments = {'simulate': 'false', 'lockstep': 'false', 'record': str(tmp_path / 'flight')}
    plan = plan_launch({**arguments, 'scenario': str(scenario)}, tmp_path)
    names = {node.executable for node in plan.nodes}
    assert names == {'navigation_node', 'guidance_node', 'control_node', 'guard_node', RECORDER}
    recorded = yaml.safe_load(parameters(plan)[f'/glider/{RECORDER}']['topics'])
    assert recorded == [
        *('imu', 'pressure', 'fix'),
        *('believed_current', 'believed_surface_current'),
    ]


@pytest.mark.parametrize(
    ('tf', 'is_installed', 'starts'),
    [('auto', False, False), ('auto', True, True), ('true', True, True), ('false', True, False)],
)
def test_transforms_are_published_where_they_can_be(tmp_path, tf2, tf, is_installed, starts):
    tf2.extend([True] * is_installed)
    plan = plan_launch({'tf': tf, 'frame_prefix': 'one/'}, tmp_path)
    assert (LaunchedNode('glider_model', TF) in plan.nodes) is starts
    values = parameters(plan)
    assert (f'/glider/{TF}' in values) is starts
    if starts:
        assert values[f'/glider/{TF}'] == {'frame_prefix': 'one/'}


def test_names_of_arguments_are_checked():
    check_names([f'{argument.name}:=x' for argument in ARGUMENTS])
    check_names(['launch-prefix:=nice', '--noninteractive'])
    with pytest.raises(ConfigurationError, match='sped:=max.*speed'):
        check_names(['scenario:=helix', 'sped:=max'])


@pytest.mark.parametrize('namespace', ['', '/'])
def test_root_namespace(tmp_path, namespace):
    plan = plan_launch({'namespace': namespace, 'lockstep': 'false'}, tmp_path)
    assert plan.namespace == '/'
    assert '/plant_node' in parameters(plan)
    assert '/guard_node' in plan.managed_names
    assert {*plan.managed_names} <= parameters(plan).keys()


def test_clock_can_lie_in_the_namespace(tmp_path):
    assert plan_launch({}, tmp_path).remappings == ()
    assert plan_launch({'clock': 'clock'}, tmp_path).remappings == (('/clock', 'clock'),)


def test_recording_adds_the_recorder_and_makes_a_run_folder(tmp_path):
    folder = tmp_path / 'flight'
    plan = plan_launch({'record': str(folder)}, tmp_path / 'log')
    assert plan.parameters_file.parent == folder
    assert LaunchedNode('glider_bringup', RECORDER) in plan.nodes
    assert {file.name for file in folder.iterdir()} == {
        'parameters.yaml',
        'scenario.yaml',
        'vehicle.yaml',
    }
    values = parameters(plan)
    assert all(entry['record'] for entry in values.values())
    recorder = values['/glider/recorder_node']
    assert recorder['folder'] == str(folder)
    assert recorder['progress'] is False
    assert yaml.safe_load(recorder['attachments']) == [
        str(folder / 'scenario.yaml'),
        str(folder / 'vehicle.yaml'),
    ]


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'scenario': 'nonsense'}, ['nonsense', 'current_8deg']),
        ({'scenario': 'no/such.yaml'}, ['no/such.yaml']),
        ({'scenario': 'eddies_hard'}, ["guidance.route = 'planned': not over nodes"]),
        ({'controller': 'bang'}, ['controller:=bang', 'adaptive, backstepping, pid']),
        ({'lockstep': 'maybe'}, ['lockstep:=maybe', 'true, false']),
        ({'speed': 'fast'}, ['speed:=fast', '0.01 to 1e+06, or max']),
        ({'speed': 'nan'}, ['speed:=nan', 'max']),
        ({'speed': '2', 'lockstep': 'false'}, ['speed:=2', '1.0 with lockstep:=false']),
        ({'simulate': 'false'}, ['lockstep:=true', 'false with simulate:=false']),
        ({'navigation': 'false'}, ['navigation:=false', 'auto or true with simulate:=true']),
        ({'tf': 'true'}, ['tf:=true', 'tf2_msgs is not installed']),
        ({'duration': '-5'}, ['duration:=-5', '0.1 to 1e+08, or full']),
        ({'namespace': 'a b'}, ['namespace:=a b']),
        ({'clock': '/time'}, ['clock:=/time', '/clock, clock']),
    ],
)
def test_what_cannot_be_used_is_refused_and_leaves_nothing(tmp_path, arguments, words):
    with pytest.raises(ConfigurationError) as error:
        plan_launch({'record': str(tmp_path / 'flight'), **arguments}, tmp_path)
    assert not [word for word in words if word not in str(error.value)], error.value
    assert list(tmp_path.iterdir()) == []


def test_choices_are_those_of_the_settings():
    choices = {argument.name: argument.choices for argument in ARGUMENTS}
    for name, model, field, before in (
        ('controller', ControlLawSettings, 'law', ()),
        ('guidance', LosSettings, 'method', ('observer', 'paper')),
    ):
        words = model.model_fields[field].annotation.__args__
        assert set(choices[name]) == {'', *words, *before}
    described = {argument.name: argument.description for argument in ARGUMENTS}
    assert all(name in described['scenario'] for name in scenario_names())


# ---------------------------------------------------------------------- with the launch system


@pytest.fixture
def launch_module():
    """The launch file as a module."""
    pytest.importorskip('launch_ros', reason='launch_ros is not installed: it comes with ROS 2')
    spec = importlib.util.spec_from_file_location('glider_launch', LAUNCH_FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def start(launch_module, tmp_path, monkeypatch):
    """Give the nodes that the launch file starts for some arguments."""
    import launch
    from launch.actions import DeclareLaunchArgument, OpaqueFunction
    from launch_ros.actions import Node

    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path))
    launch.logging.launch_config.reset()

    def run(**arguments) -> list:
        context = launch.LaunchContext()
        context.launch_configurations.update(arguments)
        actions = launch_module.generate_launch_description().entities
        for action in actions:
            if isinstance(action, DeclareLaunchArgument):
                action.execute(context)
        (opaque,) = [action for action in actions if isinstance(action, OpaqueFunction)]
        return [action for action in opaque.execute(context) if isinstance(action, Node)]

    yield run
    launch.logging.launch_config.reset()


def test_arguments_are_described_and_have_defaults(launch_module):
    declared = launch_module.generate_launch_description().get_launch_arguments()
    assert [argument.name for argument in declared] == [argument.name for argument in ARGUMENTS]
    for action, argument in zip(declared, ARGUMENTS, strict=True):
        assert argument.description in action.description
        assert ''.join(part.text for part in action.default_value) == argument.default


def test_nodes_are_those_of_the_plan(start):
    from launch import LaunchContext

    nodes = {node.node_executable: node for node in start(namespace='sea')}
    assert set(nodes) == set(MODULES) - {RECORDER}
    for name, node in nodes.items():
        assert node.node_package == MODULES[name].partition('.')[0]
        node._perform_substitutions(LaunchContext())
        assert node.expanded_node_namespace == '/sea'


def test_recorder_is_started_for_a_recording(start, tmp_path):
    names = {node.node_executable for node in start(record=str(tmp_path / 'flight'))}
    assert names == set(MODULES)


@pytest.mark.parametrize(
    ('name', 'lockstep', 'code', 'ends'),
    [
        (PLANT, 'true', 0, 'well'),
        (PLANT, 'true', 3, 'badly'),
        (PLANT, 'false', 0, 'well'),
        (PLANT, 'false', -9, 'badly'),
        ('guidance_node', 'true', 0, None),
        ('guidance_node', 'true', -9, 'badly'),
        ('guidance_node', 'false', -9, None),
        (TF, 'true', 1, None),
    ],
)
def test_end_of_a_node_ends_the_launch_when_it_has_to(
    launch_module, tmp_path, name, lockstep, code, ends
):
    """A launch service exits with 1 after an exception, and with 0 after a Shutdown."""
    import launch
    from launch.actions import Shutdown

    plan = plan_launch({'lockstep': lockstep}, tmp_path)
    on_exit = launch_module.on_exit(name, plan)
    event, context = type('Exited', (), {'returncode': code})(), launch.LaunchContext()
    if ends == 'badly':
        with pytest.raises(RuntimeError, match=f'{name} ended with exit code {code}'):
            on_exit(event, context)
    else:
        assert isinstance(on_exit(event, context), Shutdown) is (ends == 'well')
    context._set_is_shutdown(True)
    assert on_exit(event, context) is None


def test_a_launch_of_two_gliders_goes_on_until_both_have_flown(launch_module, start, tmp_path):
    """As of a launch file that includes this one twice."""
    import launch
    from launch.actions import Shutdown

    event, context = type('Exited', (), {'returncode': 0})(), launch.LaunchContext()
    ends = []
    for name in ('alpha', 'beta'):
        given = {argument.name: argument.default for argument in ARGUMENTS}
        context.launch_configurations.update(given | {'namespace': name})
        launch_module.start(context)
        plan = plan_launch({'namespace': name}, tmp_path)
        ends.append(launch_module.on_exit(PLANT, plan))
    assert [type(end(event, context)) for end in ends] == [type(None), Shutdown]


@pytest.mark.parametrize(('code', 'expected'), [(0, 0), (3, 1)])
def test_exit_code_of_a_launch_is_that_of_the_run(launch_module, tmp_path, code, expected):
    import launch
    from launch.actions import ExecuteProcess

    plan = plan_launch({}, tmp_path)
    process = ExecuteProcess(
        cmd=[sys.executable, '-c', f'raise SystemExit({code})'],
        on_exit=launch_module.on_exit(PLANT, plan),
    )
    other = ExecuteProcess(cmd=['sleep', '300'])
    service = launch.LaunchService()
    service.include_launch_description(launch.LaunchDescription([other, process]))
    assert service.run() == expected


def test_misspelt_argument_is_refused_unless_another_file_includes_this_one(
    launch_module, tmp_path, monkeypatch
):
    import launch

    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path))
    launch.logging.launch_config.reset()
    context = launch.LaunchContext(argv=['sped:=max'])
    context.launch_configurations.update({item.name: item.default for item in ARGUMENTS})
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'mine', 'mine.launch.py', 'sped:=max'])
    assert launch_module.start(context)
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'glider_bringup', LAUNCH_FILE.name])
    with pytest.raises(ConfigurationError, match='sped:=max'):
        launch_module.start(context)
    launch.logging.launch_config.reset()


def test_wrong_scenario_is_one_message(start):
    with pytest.raises(ConfigurationError, match='nonsense.*current_8deg'):
        start(scenario='nonsense')
