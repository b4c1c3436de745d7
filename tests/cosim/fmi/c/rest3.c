/* Every function of FMI 3.0 as one that fails; linked to an FMU that defines those that it has. */

#include "fmi3FunctionTypes.h"

#define NOT_THERE(name)                                                                                      \
    __attribute__((visibility("default"), weak)) fmi3Status name(fmi3Instance p) { return fmi3Error; }
#define NO_VALUES(type) NOT_THERE(fmi3Get##type) NOT_THERE(fmi3Set##type)

NO_VALUES(Float32) NO_VALUES(Float64) NO_VALUES(Int8) NO_VALUES(UInt8) NO_VALUES(Int16) NO_VALUES(UInt16)
NO_VALUES(Int32) NO_VALUES(UInt32) NO_VALUES(Int64) NO_VALUES(UInt64) NO_VALUES(Boolean) NO_VALUES(String)
NO_VALUES(Binary) NO_VALUES(Clock) NO_VALUES(FMUState) NO_VALUES(IntervalDecimal) NO_VALUES(IntervalFraction)
NO_VALUES(ShiftDecimal) NO_VALUES(ShiftFraction)

NOT_THERE(fmi3SetDebugLogging) NOT_THERE(fmi3EnterInitializationMode) NOT_THERE(fmi3ExitInitializationMode)
NOT_THERE(fmi3EnterConfigurationMode) NOT_THERE(fmi3ExitConfigurationMode) NOT_THERE(fmi3EnterEventMode)
NOT_THERE(fmi3EnterContinuousTimeMode) NOT_THERE(fmi3EnterStepMode) NOT_THERE(fmi3UpdateDiscreteStates)
NOT_THERE(fmi3EvaluateDiscreteStates) NOT_THERE(fmi3Terminate) NOT_THERE(fmi3Reset) NOT_THERE(fmi3DoStep)
NOT_THERE(fmi3ActivateModelPartition) NOT_THERE(fmi3GetOutputDerivatives)
NOT_THERE(fmi3FreeFMUState) NOT_THERE(fmi3SerializedFMUStateSize) NOT_THERE(fmi3SerializeFMUState)
NOT_THERE(fmi3DeserializeFMUState) NOT_THERE(fmi3GetNumberOfVariableDependencies)
NOT_THERE(fmi3GetVariableDependencies) NOT_THERE(fmi3GetDirectionalDerivative) NOT_THERE(fmi3GetAdjointDerivative)
NOT_THERE(fmi3CompletedIntegratorStep) NOT_THERE(fmi3SetTime) NOT_THERE(fmi3SetContinuousStates)
NOT_THERE(fmi3GetContinuousStates) NOT_THERE(fmi3GetContinuousStateDerivatives) NOT_THERE(fmi3GetEventIndicators)
NOT_THERE(fmi3GetNominalsOfContinuousStates) NOT_THERE(fmi3GetNumberOfContinuousStates)
NOT_THERE(fmi3GetNumberOfEventIndicators)

#define NO_INSTANCE(name) __attribute__((visibility("default"), weak)) void *name(void) { return 0; }
NO_INSTANCE(fmi3InstantiateModelExchange) NO_INSTANCE(fmi3InstantiateCoSimulation)
NO_INSTANCE(fmi3InstantiateScheduledExecution)
